#pragma once

#include <rosbag/bag.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include "core/camera_model.h"
#include "core/pose2.h"

namespace knav {

/// Writes depth images of a known camera motion into a bag, as a robot's that carries the camera.
/// base_link: the camera's vertical projection on the floor, looking where the camera looks.
class DepthBagWriter {
 public:
  explicit DepthBagWriter(rosbag::Bag* bag) : bag_(*bag) {}

  /// The camera's fixed part, on tf_static.
  void mount(double stamp_s);
  /// Ground truth, odometry and tf.
  void pose(double stamp_s, const Eigen::Isometry3d& T_world_optical);
  /// camera_info and the image, 16UC1 mm.
  void frame(double stamp_s, const PinholeModel& camera, const cv::Mat& depth_mm);

 private:
  rosbag::Bag& bag_;
  Pose2 T_odom_world_;
  bool started_ = false;
  sensor_msgs::CameraInfo info_;
  sensor_msgs::Image image_;
};

}  // namespace knav
