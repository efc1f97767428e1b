#include "tsdf_localizer/correction.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

constexpr double kSmall_m = 0.10, kSmall_rad = 0.035;
constexpr double kNotable_m = 0.5, kNotable_rad = 0.26;

/// The share of a step that a limit allows; 0 is no limit.
double allowed(double step, double limit) { return limit <= 0.0 || step <= limit ? 1.0 : limit / step; }

}  // namespace

const char* to_string(Correction::Rating rating) {
  return rating == Correction::Rating::kSmall ? "small" : rating == Correction::Rating::kNotable ? "notable" : "jump";
}

std::string Correction::sentence() const {
  return fmt::format("map->odom corrected by {:.3f} m and {:.2f} deg at the robot ({})", distance_m, turn_rad * 180.0 / kPi,
                     to_string(rating));
}

Correction rate_correction(const Pose2& T_map_odom_before, const Pose2& T_map_odom_after, const Pose2& T_odom_base,
                           double position_sd_m, double yaw_sd_rad) {
  const Pose2 T = (T_map_odom_before * T_odom_base).inverse() * (T_map_odom_after * T_odom_base);
  Correction c;
  c.distance_m = std::hypot(T.x_m, T.y_m);
  c.turn_rad = std::fabs(normalize_angle_rad(T.yaw_rad));
  if (c.distance_m > kNotable_m || c.turn_rad > kNotable_rad) {
    c.rating = Correction::Rating::kJump;
  } else if (c.distance_m > std::max(kSmall_m, 3.0 * position_sd_m) || c.turn_rad > std::max(kSmall_rad, 3.0 * yaw_sd_rad)) {
    c.rating = Correction::Rating::kNotable;
  }
  return c;
}

void CorrectionTally::add(const Correction& c) {
  ++count[static_cast<int>(c.rating)];
  const bool larger = c.rating != largest.rating ? c.rating > largest.rating : c.distance_m > largest.distance_m;
  if (larger) largest = c;
}

Pose2 slewed(const Pose2& T_map_odom_published, const Pose2& T_map_odom_wanted, const Pose2& T_odom_base, double dt_s,
             const SlewLimit& limit) {
  // Judged at the robot: about odometry's origin, far away, a small turn would be a long way.
  const Pose2 T_published = T_map_odom_published * T_odom_base;
  const Pose2 T_step = T_published.inverse() * (T_map_odom_wanted * T_odom_base);
  const double distance = std::hypot(T_step.x_m, T_step.y_m), turn = std::fabs(normalize_angle_rad(T_step.yaw_rad));
  if (!limit.active() || distance > limit.jump_m || turn > limit.jump_rad) return T_map_odom_wanted;
  const double share = std::min(allowed(distance, limit.speed_mps * dt_s), allowed(turn, limit.turn_radps * dt_s));
  if (share >= 1.0) return T_map_odom_wanted;
  const Pose2 T_part{share * T_step.x_m, share * T_step.y_m, share * normalize_angle_rad(T_step.yaw_rad)};
  return T_published * T_part * T_odom_base.inverse();
}

}  // namespace knav
