#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/particle_filter.h"
#include "core/pose2.h"

namespace knav {

/// How far odometry may be wrong, as standard deviations proportional to the motion, with a floor for standing.
struct MotionModelConfig {
  std::string type = "diff";
  double translation_per_translation = 0.1;  ///< [m/m]
  double translation_per_rotation = 0.02;    ///< [m/rad]
  double rotation_per_translation = 0.05;    ///< [rad/m]
  double rotation_per_rotation = 0.1;        ///< [rad/rad]
  double sideways_per_translation = 0.05;    ///< [m/m]
  double translation_floor_m = 0.002;
  double rotation_floor_rad = 0.001;

  template <class Visitor>
  void visit(Visitor& v) {
    v.choice("type", type, {"diff", "omni"}, "Drive: diff moves along its heading, omni any way.");
    v.number("translation_per_translation", translation_per_translation, 0, 2, "m/m",
             "Distance error (sd) per distance driven.");
    v.number("translation_per_rotation", translation_per_rotation, 0, 2, "m/rad",
             "Distance error (sd) per angle turned.");
    v.number("rotation_per_translation", rotation_per_translation, 0, 2, "rad/m",
             "Heading error (sd) per distance driven.");
    v.number("rotation_per_rotation", rotation_per_rotation, 0, 2, "rad/rad", "Heading error (sd) per angle turned.");
    v.number("sideways_per_translation", sideways_per_translation, 0, 2, "m/m",
             "Sideways error (sd) per distance driven.");
    v.number("translation_floor_m", translation_floor_m, 0, 0.5, "m", "Position error (sd) of a step, at least.");
    v.number("rotation_floor_rad", rotation_floor_rad, 0, 0.5, "rad", "Heading error (sd) of a step, at least.");
  }
  std::vector<std::string> validate() const { return {}; }
};

/// Standard deviations of one step's noise, in the robot's frame.
struct MotionNoise {
  double forward_m = 0.0, sideways_m = 0.0, turn_rad = 0.0;
};
MotionNoise motion_noise(const MotionModelConfig& config, const Pose2& T_before_after);

/// Moves every particle by the odometry increment plus its own noise.
/// @param T_before_after the increment in the robot's frame
/// @param seed, stream, step  see RandomStream; particle i draws from index i
void sample_motion(const MotionModelConfig& config, const Pose2& T_before_after, std::uint64_t seed,
                   std::uint32_t stream, std::uint64_t step, ParticleSet& particles);

}  // namespace knav
