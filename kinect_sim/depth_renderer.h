#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <vector>

#include "core/camera_model.h"
#include "kinect_sim/scene.h"

namespace knav {

/// Casts an image row of rays, eight at a time.
class DepthRenderer {
 public:
  explicit DepthRenderer(const PinholeModel& camera);

  /// @param T_world_optical the camera when this row is read
  /// @param z_m    [width] depth along the optical axis, +Inf where there is nothing
  /// @param signal [width] albedo x cosine of incidence; may be null
  void cast_row(const Scene& scene, const Eigen::Isometry3f& T_world_optical, int row, float* z_m,
                float* signal) const;

 private:
  PinholeModel camera_;
  std::vector<float> x_;  ///< (u - cx) / fx
};

}  // namespace knav
