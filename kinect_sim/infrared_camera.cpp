#include "kinect_sim/infrared_camera.h"

#include <algorithm>

#include "core/random.h"

namespace knav {
namespace {

constexpr float kWhite = 1023.0f, kNoise = 6.0f;
constexpr std::uint32_t kNoiseCount = 1u << 17;

PinholeModel fine(const PinholeModel& camera) {
  constexpr int k = InfraredCamera::kFine;
  return {camera.width_px * k, camera.height_px * k,           camera.fx_px * k,
          camera.fy_px * k,    (camera.cx_px + 0.5) * k - 0.5, (camera.cy_px + 0.5) * k - 0.5};
}

}  // namespace

PinholeModel InfraredCamera::camera_of(const PinholeModel& depth_camera) {
  PinholeModel camera = depth_camera;
  camera.cx_px += kOffsetX_px;
  camera.cy_px += kOffsetY_px;
  return camera;
}

InfraredCamera::InfraredCamera(const WorldMeshes& meshes, const PinholeModel& depth_camera,
                               std::uint64_t seed)
    : fine_camera_(fine(camera_of(depth_camera))),
      renderer_(meshes, fine_camera_),
      seed_(seed),
      z_m_(static_cast<std::size_t>(fine_camera_.width_px)),
      signal_(z_m_.size()),
      sum_(static_cast<std::size_t>(depth_camera.width_px)),
      noise_(kNoiseCount + sum_.size()) {
  RandomStream random(seed, random_stream::kSimInfrared, 0, 0);
  for (std::uint32_t i = 0; i < kNoiseCount; ++i) noise_[i] = static_cast<float>(random.normal(0.0, kNoise));
  std::copy_n(noise_.begin(), sum_.size(), noise_.begin() + kNoiseCount);
}

void InfraredCamera::start_frame(std::uint64_t frame_index) {
  noise_start_ = RandomStream(seed_, random_stream::kSimInfrared, frame_index, 1).bits();
}

void InfraredCamera::take_row(const Eigen::Isometry3f& T_world_optical, int fine_row, std::uint16_t* out) {
  renderer_.render_row(T_world_optical, fine_row, z_m_.data(), signal_.data());
  const int row = fine_row / kFine;
  const auto width = static_cast<int>(sum_.size());
  if (fine_row % kFine == 0) std::fill(sum_.begin(), sum_.end(), 0.0f);
  for (int u = 0; u < width; ++u) {
    for (int k = 0; k < kFine; ++k) {
      const auto i = static_cast<std::size_t>(u * kFine + k);
      sum_[static_cast<std::size_t>(u)] += signal_[i] * 1.2f / (1.0f + 0.25f * z_m_[i] * z_m_[i]);
    }
  }
  if (fine_row % kFine != kFine - 1) return;
  // Rows of a prime length apart, so that none repeats its neighbour's noise.
  const float* noise = &noise_[(noise_start_ + static_cast<std::uint32_t>(row) * 7919u) % kNoiseCount];
  std::uint16_t* pixels = out + static_cast<std::ptrdiff_t>(row) * width;
  for (int u = 0; u < width; ++u) {
    const float value = kWhite * sum_[static_cast<std::size_t>(u)] / (kFine * kFine) + noise[u];
    pixels[u] = static_cast<std::uint16_t>(std::clamp(value + 0.5f, 0.0f, kWhite));
  }
}

}  // namespace knav
