#include "tsdf_local_mapper/odometry_bound.h"

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

constexpr std::size_t kEntries = 1024;                   // of a window; at a higher rate it is shorter
constexpr double kLeast_m = 0.005, kLeast_rad = 0.0035;  // what the grid resolves

}  // namespace

OdometryBound::OdometryBound(const OdometryBoundConfig& config, const MotionModelConfig& motion)
    : config_(config), motion_(motion), ring_(kEntries) {}

bool OdometryBound::draw(const Entry& then, double coverage, Entry* now, MotionNoise* odometry_sd) const {
  const double driven_m = now->driven_m - then.driven_m, turned_rad = now->turned_rad - then.turned_rad;
  // A wheel's wrong radius is wrong in every step: the errors of the window's steps add up as they are.
  const double sd_m = motion_.translation_per_translation * driven_m + motion_.translation_per_rotation * turned_rad;
  const double sd_rad = motion_.rotation_per_translation * driven_m + motion_.rotation_per_rotation * turned_rad;
  const double k = config_.sds * coverage / config_.coverage;
  const double most_m = k * sd_m + kLeast_m, most_rad = k * sd_rad + kLeast_rad;
  const Pose2 T_local_expected = then.T_local_base * (then.T_odom_base.inverse() * now->T_odom_base);
  Pose2 T_expected_base = T_local_expected.inverse() * now->T_local_base;
  const double off_m = std::hypot(T_expected_base.x_m, T_expected_base.y_m);
  const double off_rad = normalize_angle_rad(T_expected_base.yaw_rad);
  if (off_m <= most_m && std::fabs(off_rad) <= most_rad) return false;
  const double share = off_m > most_m ? most_m / off_m : 1.0;
  T_expected_base = {T_expected_base.x_m * share, T_expected_base.y_m * share, std::clamp(off_rad, -most_rad, most_rad)};
  now->T_local_base = T_local_expected * T_expected_base;
  *odometry_sd = {sd_m + kLeast_m, sd_m + kLeast_m, sd_rad + kLeast_rad};
  return true;
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
    drawn = coverage < config_.coverage && draw(at(0), coverage, &now, odometry_sd);
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
