#include "core/motion_model.h"

#include <cmath>

#include "core/random.h"

namespace knav {

void sample_motion(const MotionModelConfig& config, const Pose2& T_before_after, std::uint64_t seed,
                   std::uint32_t stream, std::uint64_t step, ParticleSet& particles) {
  const double distance = std::hypot(T_before_after.x_m, T_before_after.y_m);
  const double turn = std::fabs(T_before_after.yaw_rad);
  const double forward_sd = std::hypot(config.translation_per_translation * distance,
                                       config.translation_per_rotation * turn, config.translation_floor_m);
  const double sideways_ratio =
      config.type == "omni" ? config.translation_per_translation : config.sideways_per_translation;
  const double sideways_sd =
      std::hypot(sideways_ratio * distance, config.translation_per_rotation * turn, config.translation_floor_m);
  const double turn_sd = std::hypot(config.rotation_per_translation * distance, config.rotation_per_rotation * turn,
                                    config.rotation_floor_rad);
  for (std::size_t i = 0; i < particles.size(); ++i) {
    RandomStream random(seed, stream, step, static_cast<std::uint32_t>(i));
    const double along = random.normal(), across = random.normal(), yaw = random.normal();
    const Pose2 T_before_sample{T_before_after.x_m + forward_sd * along, T_before_after.y_m + sideways_sd * across,
                                T_before_after.yaw_rad + turn_sd * yaw};
    particles.set(i, particles.pose(i) * T_before_sample);
  }
}

}  // namespace knav
