#pragma once

#include <string>
#include <vector>

namespace knav {

/// A range finder that looks at a wall from a robot at rest varies by no more than this: five times the 2 mm
/// of a consumer's laser, and a little.
constexpr double kSteadyRangeWithin_m = 0.015;

/// The readings of a range finder while the robot stands.
class StandingRange {
 public:
  void clear() { readings_m_.clear(); }
  void add(double range_m) { readings_m_.push_back(range_m); }
  int count() const { return static_cast<int>(readings_m_.size()); }
  double median_m() const;
  double sd_m() const;
  /// Why the readings are no distance, in a sentence's second half; empty if they are.
  std::string fault() const;

 private:
  std::vector<double> readings_m_;
};

}  // namespace knav
