#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "kinect_calib/depth_calibration.h"
#include "kinect_sim/kinect_model.h"

namespace knav {

/// Frames of a flat wall, as calibrate_depth is given them.
class WallView {
 public:
  WallView(const KinectConfig& kinect, std::uint64_t seed, std::uint64_t device_seed);
  const PinholeModel& camera() const { return camera_; }
  /// A wall that fills the view: 1 / z = (1 + tilt_x x + tilt_y y) / distance.
  /// @param depth_m 32FC1 m, NaN invalid, as the sensor gives it
  void sense(double distance_m, double tilt_x, double tilt_y, cv::Mat* depth_m);

 private:
  PinholeModel camera_;
  KinectModel kinect_;
  std::uint64_t frame_ = 0;
  cv::Mat depth_mm_;
  std::vector<float> z_m_, signal_;
};

/// Calibrates one simulated device as the paper's section III.B says: 0.5-4 m in steps of 5-15 %, a range
/// finder of sd 2 mm read once per wall, the robot square to the wall within a few tenths of a degree.
/// @param frames of each wall, averaged
DepthCalibration calibrate_device(const KinectConfig& kinect, std::uint64_t seed, std::uint64_t device_seed,
                                  int frames);

/// The models that kinect_calib offers, by the names of depth_correction/model.
std::vector<std::string> depth_model_names();

}  // namespace knav
