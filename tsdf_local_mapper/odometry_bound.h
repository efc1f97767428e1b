#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "core/motion_model.h"
#include "core/pose2.h"

namespace knav {

/// When what the camera sees may be moving as a whole.
struct OdometryBoundConfig {
  double coverage = 0.5;
  double window_s = 2.0;
  double sds = 2.0;
  double learned_sds = 6.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("coverage", coverage, 0, 1, "",
             "Where readings that have a say cover less of the view than this, alignment is bounded by odometry: somebody who "
             "walks past in an empty hall is all that is seen, and the robot seems to turn after him. 0 = never.");
    v.number("window_s", window_s, 0.1, 30, "s", "Over this long estimate and odometry are compared.");
    v.number("sds", sds, 0, 100, "",
             "The bound at that coverage, in standard deviations of the motion model; with less in view it falls in proportion.");
    v.number("learned_sds", learned_sds, 0, 100, "",
             "The same in standard deviations of what odometry was found to err by while more was in view: most robots' odometry is far better than "
             "a motion model has to allow for. The tighter of the two holds; 0 = the motion model's.");
  }
};

/// Of what odometry errs by over a window, in standard deviations of the motion model: the rms, over the last minutes.
class OdometryQuality {
 public:
  static constexpr double kFewest = 10.0, kMost = 100.0;  ///< windows

  void add(double sds) {
    const double kept = count_ < kMost ? 1.0 : (kMost - 1.0) / kMost;
    squares_ = kept * squares_ + sds * sds;
    count_ = kept * count_ + 1.0;
  }
  /// 1 until enough is known.
  double rms_sds() const { return count_ < kFewest ? 1.0 : std::max(kLeast, std::sqrt(squares_ / count_)); }

 private:
  static constexpr double kLeast = 0.02;
  double squares_ = 0.0, count_ = 0.0;
};

/// Keeps an estimate to odometry where little is in view. Not in the paper, whose equation 6 lets alignment alone decide.
class OdometryBound {
 public:
  OdometryBound(const OdometryBoundConfig& config, const MotionModelConfig& motion);

  /// Forgets the window, not what odometry is worth.
  void reset() {
    size_ = 0;
    learn_from_s_ = -1e9;
  }
  /// To be called for each frame, with rising stamps.
  /// @param coverage      share of the view in [0, 1] that the readings cover which have a say
  /// @param T_local_base  the aligned estimate; drawn towards what odometry says of the last window_s if the two differ by
  /// more than the bound, and then the answer is true
  /// @param odometry_sd   set when the answer is true: how far odometry itself may be wrong over the window
  bool bound(double stamp_s, const Pose2& T_odom_base, double coverage, Pose2* T_local_base, MotionNoise* odometry_sd);

 private:
  struct Entry {
    double stamp_s = 0.0;
    Pose2 T_odom_base, T_local_base;
    double driven_m = 0.0, turned_rad = 0.0;  ///< since the start, all ways added up
  };
  /// How the window's motion by the estimate differs from odometry's.
  struct Difference {
    Pose2 T_local_expected, T_expected_base;
    double off_m, off_rad;
    double sd_m, sd_rad;  ///< of odometry, by the motion model
  };
  const Entry& at(std::size_t i) const { return ring_[(first_ + i) % ring_.size()]; }
  Difference difference(const Entry& then, const Entry& now) const;
  bool draw(const Entry& then, double coverage, Entry* now, MotionNoise* odometry_sd) const;
  void learn(const Entry& then, const Entry& now);

  OdometryBoundConfig config_;
  MotionModelConfig motion_;
  std::vector<Entry> ring_;
  std::size_t first_ = 0, size_ = 0;
  OdometryQuality distance_quality_, turn_quality_;
  double learn_from_s_ = -1e9;  ///< windows that begin before are not learned from: the last one learned, or with little in view
};

}  // namespace knav
