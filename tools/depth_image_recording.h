#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/camera_model.h"

namespace knav {

struct StampedCameraPose {
  double stamp_s = 0.0;
  Eigen::Isometry3d T_world_optical = Eigen::Isometry3d::Identity();
};

struct DepthImage {
  double stamp_s = 0.0;
  std::string file;
};

/// A folder of depth images with the camera's poses.
struct DepthImageRecording {
  PinholeModel camera = {640, 480, 585.0, 585.0, 320.0, 240.0};
  double mm_per_unit = 1.0;
  std::uint16_t invalid = 65535;         // besides 0
  std::vector<DepthImage> frames;        // by stamp
  std::vector<StampedCameraPose> poses;  // by stamp
  bool level = true;                     // world z is up and the floor lies at 0
};

/// Frames `data/frame-000000.depth.png` with `data/frame-000000.pose.txt` (camera to world, 4x4); no stamps.
/// UserError if the folder holds something else.
DepthImageRecording read_seven_scenes(const std::string& folder, double rate_hz);

/// `depth.txt` (stamp file), `depth/`, `groundtruth.txt` (t tx ty tz qx qy qz qw, motion capture with z up).
/// UserError if the folder holds something else.
DepthImageRecording read_tum(const std::string& folder);

/// The pose at a stamp, between its neighbours; false outside or in a gap of more than 0.1 s.
bool pose_at(const std::vector<StampedCameraPose>& poses, double stamp_s, Eigen::Isometry3d* T_world_optical);

/// 16UC1 mm, 0 invalid.
cv::Mat read_depth(const DepthImageRecording& recording, const DepthImage& frame);

}  // namespace knav
