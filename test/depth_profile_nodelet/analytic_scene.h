#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <limits>
#include <opencv2/core.hpp>
#include <vector>

#include "core/camera_model.h"
#include "core/random.h"
#include "kinect_calib/kinect_noise.h"

namespace knav::test {

/// A flat rectangle in the base frame: corner + s a + t b, s and t in [0, 1].
struct Patch {
  Eigen::Vector3d corner, a, b;
};

/// Scenes of flat patches, rendered exactly: the answer of every pixel can be worked out by hand.
struct Scene {
  std::vector<Patch> patches;

  void floor(double z_m = 0.0, double from_x_m = -50.0, double to_x_m = 100.0) {
    patches.push_back({{from_x_m, -50, z_m}, {to_x_m - from_x_m, 0, 0}, {0, 100, 0}});
  }
  /// Across the robot's way, from y to y + width.
  void wall(double x_m, double y_m = -50.0, double width_m = 100.0, double bottom_m = 0.0,
            double top_m = 3.0) {
    patches.push_back({{x_m, y_m, bottom_m}, {0, width_m, 0}, {0, 0, top_m - bottom_m}});
  }
  void box(double x_m, double y_m, double depth_m, double width_m, double bottom_m, double top_m) {
    wall(x_m, y_m, width_m, bottom_m, top_m);
    patches.push_back({{x_m, y_m, top_m}, {depth_m, 0, 0}, {0, width_m, 0}});
    patches.push_back({{x_m, y_m, bottom_m}, {depth_m, 0, 0}, {0, width_m, 0}});
    patches.push_back({{x_m, y_m, bottom_m}, {depth_m, 0, 0}, {0, 0, top_m - bottom_m}});
    patches.push_back({{x_m, y_m + width_m, bottom_m}, {depth_m, 0, 0}, {0, 0, top_m - bottom_m}});
  }
  /// Distance along `direction` (any length) to the nearest patch, in units of its length; +Inf if none.
  double cast(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Patch& p : patches) {
      const Eigen::Vector3d normal = p.a.cross(p.b);
      const double t = normal.dot(p.corner - from) / normal.dot(direction);
      if (!(t > 1e-6) || t >= nearest) continue;
      const Eigen::Vector3d hit = from + t * direction - p.corner;
      const double s = hit.dot(p.a) / p.a.squaredNorm(), r = hit.dot(p.b) / p.b.squaredNorm();
      if (s >= 0 && s <= 1 && r >= 0 && r <= 1) nearest = t;
    }
    return nearest;
  }
};

inline PinholeModel kinect_camera() { return {640, 480, 585.0, 585.0, 319.5, 239.5}; }

/// The optical frame of a camera at a height that looks along base x; positive pitch looks down, positive
/// roll lowers its right side.
inline Eigen::Isometry3d mount(double height_m = 0.5, double pitch_deg = 0.0, double roll_deg = 0.0,
                               double yaw_deg = 0.0, double x_m = 0.0) {
  const double to_rad = M_PI / 180.0;
  Eigen::Matrix3d base_from_level_optical;
  base_from_level_optical << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = (Eigen::AngleAxisd(yaw_deg * to_rad, Eigen::Vector3d::UnitZ()) *
                Eigen::AngleAxisd(pitch_deg * to_rad, Eigen::Vector3d::UnitY()) *
                Eigen::AngleAxisd(roll_deg * to_rad, Eigen::Vector3d::UnitX()))
                   .toRotationMatrix() *
               base_from_level_optical;
  T.translation() = Eigen::Vector3d(x_m, 0.0, height_m);
  return T;
}

/// 32FC1 m. @param T_base_optical_of_row where the camera was while it read a row
inline cv::Mat render(const Scene& scene, const PinholeModel& camera,
                      const std::function<Eigen::Isometry3d(int)>& T_base_optical_of_row) {
  cv::Mat depth(camera.height_px, camera.width_px, CV_32FC1);
  for (int v = 0; v < camera.height_px; ++v) {
    const Eigen::Isometry3d T = T_base_optical_of_row(v);
    for (int u = 0; u < camera.width_px; ++u) {
      const Eigen::Vector3d ray((u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px, 1.0);
      const double z = scene.cast(T.translation(), T.linear() * ray);  // ray.z = 1: the multiple is the depth
      depth.at<float>(v, u) =
          std::isfinite(z) ? static_cast<float>(z) : std::numeric_limits<float>::quiet_NaN();
    }
  }
  return depth;
}
inline cv::Mat render(const Scene& scene, const PinholeModel& camera,
                      const Eigen::Isometry3d& T_base_optical) {
  return render(scene, camera, [&](int) { return T_base_optical; });
}

/// The Kinect's noise: disparity codes with sd 0.55, correlated along the row (0.66 at 1 px, 0.29 at 4 px),
/// quantised; nothing nearer than 0.5 m.
inline void add_kinect_noise(cv::Mat* depth, std::uint64_t seed, double sd_codes = 0.55) {
  for (int v = 0; v < depth->rows; ++v) {
    RandomStream random(seed, random_stream::kTest, 0, static_cast<std::uint32_t>(v));
    double slow = random.normal(), fast = random.normal();
    for (int u = 0; u < depth->cols; ++u) {
      slow = 0.9 * slow + std::sqrt(1 - 0.81) * random.normal();  // mixture: 0.45 x 0.9^k + 0.55 x 0.46^k
      fast = 0.46 * fast + std::sqrt(1 - 0.46 * 0.46) * random.normal();
      float& z = depth->at<float>(v, u);
      if (std::isnan(z)) continue;
      const double code =
          1.0 / (z * kInverseDepthPerCode) + sd_codes * (std::sqrt(0.45) * slow + std::sqrt(0.55) * fast);
      z = static_cast<float>(1.0 / (std::max(1.0, std::round(code)) * kInverseDepthPerCode));
      if (z < 0.5f) z = std::numeric_limits<float>::quiet_NaN();
    }
  }
}

inline cv::Mat to_millimetres(const cv::Mat& depth) {
  cv::Mat mm(depth.rows, depth.cols, CV_16UC1);
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u) {
      const float z = depth.at<float>(v, u);
      mm.at<std::uint16_t>(v, u) = z < 65.0f ? static_cast<std::uint16_t>(std::lround(z * 1000.0f)) : 0;
    }
  }
  return mm;
}

}  // namespace knav::test
