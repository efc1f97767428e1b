#include "core/motion_model.h"

#include <cmath>

#include "core/fast_math.h"
#include "core/random.h"

namespace knav {

MotionNoise motion_noise(const MotionModelConfig& config, const Pose2& T_before_after) {
  const double distance = std::hypot(T_before_after.x_m, T_before_after.y_m);
  const double turn = std::fabs(T_before_after.yaw_rad);
  const double sideways_ratio =
      config.type == "omni" ? config.translation_per_translation : config.sideways_per_translation;
  return {std::hypot(config.translation_per_translation * distance, config.translation_per_rotation * turn,
                     config.translation_floor_m),
          std::hypot(sideways_ratio * distance, config.translation_per_rotation * turn, config.translation_floor_m),
          std::hypot(config.rotation_per_translation * distance, config.rotation_per_rotation * turn,
                     config.rotation_floor_rad)};
}

void sample_motion(const MotionModelConfig& config, const Pose2& T_before_after, std::uint64_t seed,
                   std::uint32_t stream, std::uint64_t step, ParticleSet& particles) {
  const MotionNoise sd = motion_noise(config, T_before_after);
  static thread_local std::vector<double> cosine, sine;
  cosine.resize(particles.size());
  sine.resize(particles.size());
  cos_sin(particles.yaw_rad.data(), particles.size(), cosine.data(), sine.data());
  for (std::size_t i = 0; i < particles.size(); ++i) {
    double noise[3];
    three_normals(seed, stream, step, static_cast<std::uint32_t>(i), noise);
    const double x = T_before_after.x_m + sd.forward_m * noise[0], y = T_before_after.y_m + sd.sideways_m * noise[1];
    const double yaw = particles.yaw_rad[i] + T_before_after.yaw_rad + sd.turn_rad * noise[2];
    particles.x_m[i] += cosine[i] * x - sine[i] * y;
    particles.y_m[i] += sine[i] * x + cosine[i] * y;
    particles.yaw_rad[i] = yaw - 2.0 * kPi * rounded(yaw / (2.0 * kPi));
  }
}

}  // namespace knav
