#include "tsdf_local_mapper/odometry_bound.h"

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

constexpr std::size_t kEntries = 1024;                   // of a window; at a higher rate it is shorter
constexpr double kLeast_m = 0.005, kLeast_rad = 0.0035;  // what the grid resolves
constexpr double kAlways_sds = 2.0;                       // of those learned, however little is in view: odometry errs by as much often
constexpr double kMoved_m = 0.01, kMoved_rad = 0.02;     // of the motion model's deviations: less says nothing of them

}  // namespace

OdometryBound::OdometryBound(const OdometryBoundConfig& config, const MotionModelConfig& motion)
    : config_(config), motion_(motion), ring_(kEntries) {}

OdometryBound::Difference OdometryBound::difference(const Entry& then, const Entry& now) const {
  const double driven_m = now.driven_m - then.driven_m, turned_rad = now.turned_rad - then.turned_rad;
  Difference d;
  // A wheel's wrong radius is wrong in every step: the errors of the window's steps add up as they are.
  d.sd_m = motion_.translation_per_translation * driven_m + motion_.translation_per_rotation * turned_rad;
  d.sd_rad = motion_.rotation_per_translation * driven_m + motion_.rotation_per_rotation * turned_rad;
  d.T_local_expected = then.T_local_base * (then.T_odom_base.inverse() * now.T_odom_base);
  d.T_expected_base = d.T_local_expected.inverse() * now.T_local_base;
  d.off_m = std::hypot(d.T_expected_base.x_m, d.T_expected_base.y_m);
  d.off_rad = normalize_angle_rad(d.T_expected_base.yaw_rad);
  return d;
}

bool OdometryBound::draw(const Entry& then, double coverage, Entry* now, MotionNoise* odometry_sd) const {
  const Difference d = difference(then, *now);
  const auto sds = [&](const OdometryQuality& quality) {
    const double share = coverage / config_.coverage, by_model = config_.sds * share;
    if (config_.learned_sds <= 0.0) return by_model;
    return std::min(by_model, std::max(config_.learned_sds * share, kAlways_sds) * quality.rms_sds());
  };
  const double most_m = sds(distance_quality_) * d.sd_m + kLeast_m, most_rad = sds(turn_quality_) * d.sd_rad + kLeast_rad;
  if (d.off_m <= most_m && std::fabs(d.off_rad) <= most_rad) return false;
  const double share = d.off_m > most_m ? most_m / d.off_m : 1.0;
  now->T_local_base = d.T_local_expected * Pose2{d.T_expected_base.x_m * share, d.T_expected_base.y_m * share, std::clamp(d.off_rad, -most_rad, most_rad)};
  *odometry_sd = {d.sd_m + kLeast_m, d.sd_m + kLeast_m, d.sd_rad + kLeast_rad};
  return true;
}

/// From windows that do not overlap, in which the robot moved and enough was in view all the time.
void OdometryBound::learn(const Entry& then, const Entry& now) {
  if (then.stamp_s < learn_from_s_ || now.stamp_s - then.stamp_s < 0.9 * config_.window_s) return;
  const Difference d = difference(then, now);
  learn_from_s_ = now.stamp_s;
  if (d.sd_m > kMoved_m) distance_quality_.add(d.off_m / d.sd_m);
  if (d.sd_rad > kMoved_rad) turn_quality_.add(d.off_rad / d.sd_rad);
}

bool OdometryBound::bound(double stamp_s, const Pose2& T_odom_base, double coverage, Pose2* T_local_base,
                          MotionNoise* odometry_sd) {
  if (config_.coverage <= 0.0) return false;
  Entry now{stamp_s, T_odom_base, *T_local_base, 0.0, 0.0};
  bool drawn = false;
  if (size_ > 0) {
    const Entry& last = at(size_ - 1);
    const Pose2 T_step = last.T_odom_base.inverse() * T_odom_base;
    now.driven_m = last.driven_m + std::hypot(T_step.x_m, T_step.y_m);
    now.turned_rad = last.turned_rad + std::fabs(normalize_angle_rad(T_step.yaw_rad));
    while (size_ > 1 && at(1).stamp_s <= stamp_s - config_.window_s) {
      first_ = (first_ + 1) % ring_.size();
      --size_;
    }
    if (coverage >= config_.coverage) {
      learn(at(0), now);
    } else {
      learn_from_s_ = stamp_s;
      drawn = draw(at(0), coverage, &now, odometry_sd);
    }
  }
  if (size_ == ring_.size()) {
    first_ = (first_ + 1) % ring_.size();
    --size_;
  }
  ring_[(first_ + size_) % ring_.size()] = now;
  ++size_;
  *T_local_base = now.T_local_base;
  return drawn;
}

}  // namespace knav
