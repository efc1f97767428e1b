#pragma once

#include "core/pose2.h"

namespace knav {

/// Learns the steady errors of wheel odometry (wheel size, wheel distance, a skewed mount) from the poses
/// that the map confirmed, and takes them out of the increments before noise is added. Recursive least
/// squares with forgetting over a distance, drawn towards "no error".
class OdometryLearner {
 public:
  /// @param memory_m distance over which it forgets; 0 switches it off
  explicit OdometryLearner(double memory_m) : memory_m_(memory_m) {}

  void reset();
  /// Odometry and estimate of the same step.
  void learn(const Pose2& T_odometry_step, const Pose2& T_estimated_step);
  /// The increment without the learned errors.
  Pose2 corrected(const Pose2& T_odometry_step) const;

 private:
  double memory_m_;
  // Sums over the recent past of products: forward f, lateral l, turn t; o = odometry, e = estimate -
  // odometry.
  double fo_fo_ = 0, fo_ef_ = 0, fo_el_ = 0, fo_et_ = 0, fo_to_ = 0, to_to_ = 0, to_et_ = 0;
  double scale_ = 0, sideways_ = 0, turn_per_m_ = 0, turn_scale_ = 0;
};

}  // namespace knav
