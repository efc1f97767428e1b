#include "tsdf_local_mapper/odometry_learner.h"

#include <algorithm>
#include <cmath>

namespace knav {

void OdometryLearner::reset() { *this = OdometryLearner(memory_m_); }

void OdometryLearner::learn(const Pose2& odometry, const Pose2& estimate) {
  if (memory_m_ <= 0.0) return;
  const double f = odometry.x_m, t = odometry.yaw_rad;
  const double keep = std::exp(-std::hypot(f, odometry.y_m) / memory_m_);
  const auto sum = [&](double& s, double product) { s = keep * s + product; };
  const double ef = estimate.x_m - f, el = estimate.y_m - odometry.y_m;
  const double et = normalize_angle_rad(estimate.yaw_rad - t);
  sum(fo_fo_, f * f);
  sum(fo_ef_, f * ef);
  sum(fo_el_, f * el);
  sum(fo_et_, f * et);
  sum(fo_to_, f * t);
  sum(to_to_, t * t);
  sum(to_et_, t * et);
  // The prior is worth about as much as 2 m driven, or 1 rad turned, in steps of 0.1.
  const double a = fo_fo_ + 0.2, b = fo_to_, d = to_to_ + 0.1;
  const auto bounded = [](double v, double limit) { return std::clamp(v, -limit, limit); };
  scale_ = bounded(fo_ef_ / a, 0.1);
  sideways_ = bounded(fo_el_ / a, 0.1);
  const double determinant = a * d - b * b;
  turn_per_m_ = bounded((fo_et_ * d - b * to_et_) / determinant, 0.1);
  turn_scale_ = bounded((a * to_et_ - b * fo_et_) / determinant, 0.15);
}

Pose2 OdometryLearner::corrected(const Pose2& step) const {
  return {step.x_m * (1.0 + scale_), step.y_m + sideways_ * step.x_m,
          normalize_angle_rad(step.yaw_rad * (1.0 + turn_scale_) + turn_per_m_ * step.x_m)};
}

}  // namespace knav
