#pragma once

#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Range.h>

#include <memory>
#include <string>
#include <vector>

#include "kinect_calib/depth_corrector.h"
#include "kinect_calib/guided_calibration.h"
#include "kinect_calib/wall_loader.h"
#include "kinect_calib/wall_viewer.h"

namespace knav {

struct LiveTopics : WallTopics {
  std::string odometry = "odom", command = "cmd_vel", infrared = "camera/ir/image",
              infrared_info = "camera/ir/camera_info";
};

/// The robot before its wall, as topics: gathers what GuidedCalibration wants to know, and draws the view.
class LiveWall {
 public:
  LiveWall(const LiveTopics& topics, bool range_finder);

  /// What came since the last call.
  GuidedInput take(double now_s);
  /// The newest depth image as the sensor gave it, 16UC1 mm.
  const cv::Mat& raw() const { return raw_; }
  const RawCamera& camera() const { return camera_; }
  /// The newest image in metres, lens rectified.
  const cv::Mat& depth_m() const { return depth_m_; }

  /// Publishes `calibration_view` if somebody looks; IR is subscribed to only then.
  void show(const std::vector<std::string>& lines);

 private:
  void on_image(const sensor_msgs::ImageConstPtr& message);
  void on_range(const sensor_msgs::Range& message);

  LiveTopics topics_;
  ros::NodeHandle node_;
  ros::Subscriber depth_subscriber_, info_subscriber_, odometry_subscriber_, range_subscriber_,
      infrared_subscriber_, infrared_info_subscriber_;
  ros::Publisher view_publisher_;

  RawCamera camera_;
  DepthCorrector corrector_;
  std::unique_ptr<WallViewer> viewer_;
  PinholeModel viewer_camera_;
  cv::Mat raw_, depth_m_;
  GuidedInput input_;

  sensor_msgs::ImageConstPtr infrared_;
  sensor_msgs::CameraInfoConstPtr infrared_info_;
  ros::WallTime infrared_came_, shown_;
};

}  // namespace knav
