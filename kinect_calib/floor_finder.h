#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "core/camera_model.h"

namespace knav {

/// How the camera stands above the floor, by which T_base_camera = Rz(yaw) Ry(pitch) Rx(roll) and its z are
/// known but for the yaw (camera: x forward, y left, z up).
struct FloorMount {
  double height_m = 0.0;
  double pitch_rad = 0.0;  ///< positive looks down
  double roll_rad = 0.0;   ///< about the viewing direction

  /// Turns a vector from the camera's axes to level ones with the same heading.
  Eigen::Matrix3d R_level_camera() const;
};

struct FloorFinderConfig {
  double range_max_m = 4.0;
  double tilt_max_deg = 50.0;  ///< of the camera against the floor
  double height_min_m = 0.1, height_max_m = 2.0;
  double inlier_codes = 3.0;  ///< disparity codes of 1/8 px
  int min_points = 400;       ///< of a grid of every fourth pixel
  int min_rows_px = 40, min_columns_px = 200;
  int samples = 150;
  std::uint64_t seed = 1;
};

/// The floor in one depth frame when nothing is known of the mount: the plane, within tilt_max_deg of level,
/// that most readings lie on and hardly any below (a table top has floor below it). In inverse depth, where a
/// plane is linear in the pixel and noise uniform.
class FloorFinder {
 public:
  explicit FloorFinder(const FloorFinderConfig& config) : config_(config) {}

  /// @param depth 32FC1 m, NaN invalid, rectified
  /// @param frame_index keys the random samples
  /// @return false if the frame shows no floor
  bool find(const cv::Mat& depth, const PinholeModel& camera, std::uint64_t frame_index, FloorMount* mount);

 private:
  struct Reading {
    double x, y, per_m;  // normalised image coordinates, inverse depth
  };
  bool plausible(const Eigen::Vector3d& plane) const;
  bool refine(Eigen::Vector3d* plane) const;
  bool wide_enough(const Eigen::Vector3d& plane, const PinholeModel& camera) const;

  FloorFinderConfig config_;
  std::vector<Reading> readings_;
};

}  // namespace knav
