#pragma once

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

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("coverage", coverage, 0, 1, "",
             "Where readings that have a say cover less of the view than this, alignment is bounded by odometry: somebody who "
             "walks past in an empty hall is all that is seen, and the robot seems to turn after him. 0 = never.");
    v.number("window_s", window_s, 0.1, 30, "s", "Over this long estimate and odometry are compared.");
    v.number("sds", sds, 0, 100, "",
             "The bound at that coverage, in standard deviations of the motion model; with less in view it falls in proportion.");
  }
};

/// Keeps an estimate to odometry where little is in view. Not in the paper, whose equation 6 lets alignment alone decide.
class OdometryBound {
 public:
  OdometryBound(const OdometryBoundConfig& config, const MotionModelConfig& motion);

  void reset() { size_ = 0; }
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
  const Entry& at(std::size_t i) const { return ring_[(first_ + i) % ring_.size()]; }
  bool draw(const Entry& then, double coverage, Entry* now, MotionNoise* odometry_sd) const;

  OdometryBoundConfig config_;
  MotionModelConfig motion_;
  std::vector<Entry> ring_;
  std::size_t first_ = 0, size_ = 0;
};

}  // namespace knav
