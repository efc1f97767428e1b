#pragma once

#include <cstdint>
#include <string>

#include "core/pose2.h"

namespace knav {

/// How much a new estimate moved the robot in the map, beyond what odometry said.
struct Correction {
  /// small: within what one expects of tracking; notable: a person would see it; jump: the robot was elsewhere than it thought.
  enum class Rating { kSmall, kNotable, kJump };
  double distance_m = 0.0, turn_rad = 0.0;
  Rating rating = Rating::kSmall;
  std::string sentence() const;
};
const char* to_string(Correction::Rating rating);

/// @param T_map_odom_before, T_map_odom_after the estimates, both for the robot at T_odom_base
/// @param position_sd_m, yaw_sd_rad of the estimate before: what is within three of them is no surprise
Correction rate_correction(const Pose2& T_map_odom_before, const Pose2& T_map_odom_after, const Pose2& T_odom_base,
                           double position_sd_m, double yaw_sd_rad);

/// How many of each rating, and the largest, since they were last asked for.
struct CorrectionTally {
  std::uint32_t count[3] = {0, 0, 0};
  Correction largest;
  void add(const Correction& correction);
};

/// Leads the published map->odom after the estimate at a limited speed of the robot in the map, for consumers that cannot
/// bear steps. What is larger than `jump_*` is taken at once: there the old pose was wrong, and to creep through walls helps
/// nobody.
struct SlewLimit {
  double speed_mps = 0.0, turn_radps = 0.0;  ///< 0: no limit
  double jump_m = 0.5, jump_rad = 0.5;
  bool active() const { return speed_mps > 0.0 || turn_radps > 0.0; }
};
Pose2 slewed(const Pose2& T_map_odom_published, const Pose2& T_map_odom_wanted, const Pose2& T_odom_base, double dt_s,
             const SlewLimit& limit);

}  // namespace knav
