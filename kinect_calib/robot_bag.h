#pragma once

#include <functional>
#include <string>

#include "core/pose2.h"
#include "kinect_calib/depth_corrector.h"
#include "kinect_calib/rectification.h"
#include "ros_common/bag_reader.h"

namespace knav {

struct RobotTopics {
  std::string depth = "camera/depth/image_raw", camera_info = "camera/depth/camera_info", odometry = "odom";
};

/// Reads a drive with depth and odometry, lens rectified and depth corrected, in the order of recording.
class RobotBag {
 public:
  /// UserError if a topic is missing.
  /// @param calibration_file by calibrate_depth; empty: depths as the sensor gives them
  RobotBag(const std::string& path, const RobotTopics& topics, const std::string& calibration_file);

  struct Visitor {
    std::function<void(const cv::Mat& depth_m, const PinholeModel& camera, double stamp_s)> frame;
    std::function<void(double stamp_s, const Pose2& T_odom_base)> odometry;
  };
  /// UserError if a message is of another type, or depth is no depth image.
  void read(const std::string& stage, const Visitor& visitor);

 private:
  BagReader bag_;
  RobotTopics topics_;
  DepthCorrector corrector_;
};

}  // namespace knav
