#pragma once

#include <cstdint>
#include <vector>

#include "kinect_sim/depth_renderer.h"

namespace knav {

/// The Kinect's IR image, 10 bits, its projector covered and a lamp beside the camera, as for a calibration:
/// a picture to find chessboards and markers in, not a radiometric model. Each pixel is the mean of four
/// rays, and white noise is added. The camera is the depth image's, its principal point moved as in a Kinect,
/// whose depth image is shifted against its IR image. Deterministic by (seed, frame).
class InfraredCamera {
 public:
  static constexpr double kOffsetX_px = 5.0,
                          kOffsetY_px = 4.0;  ///< IR image's principal point minus the depth's

  InfraredCamera(const WorldMeshes& meshes, const PinholeModel& depth_camera, std::uint64_t seed);
  static PinholeModel camera_of(const PinholeModel& depth_camera);

  /// The renderer of the rays, which has kFine times the image's rows and columns.
  static constexpr int kFine = 2;
  DepthRenderer& renderer() { return renderer_; }
  void start_frame(std::uint64_t frame_index);
  /// Rows of rays in rising order; every kFine-th completes a row of the image.
  /// @param out the image's first row
  void take_row(const Eigen::Isometry3f& T_world_optical, int fine_row, std::uint16_t* out);

 private:
  PinholeModel fine_camera_;
  DepthRenderer renderer_;
  std::uint64_t seed_;
  std::vector<float> z_m_, signal_, sum_, noise_;
  std::uint32_t noise_start_ = 0;
};

}  // namespace knav
