#include "kinect_calib/robot_bag.h"

#include <fmt/format.h>
#include <nav_msgs/Odometry.h>

#include "core/error.h"
#include "core/progress.h"
#include "kinect_calib/depth_messages.h"
#include "ros_common/conversions.h"

namespace knav {
namespace {

DepthCorrectionConfig correction(const std::string& calibration_file) {
  DepthCorrectionConfig config;
  config.calibration_file = calibration_file;
  return config;
}

}  // namespace

RobotBag::RobotBag(const std::string& path, const RobotTopics& topics, const std::string& calibration_file)
    : bag_(path), topics_(topics), corrector_(correction(calibration_file)) {
  bag_.require_topic(topics.depth);
  bag_.require_topic(topics.camera_info);
  bag_.require_topic(topics.odometry);
}

void RobotBag::read(const std::string& stage, const Visitor& visitor) {
  Progress progress(stage);
  RawCamera camera;
  cv::Mat view, depth_m;
  std::string fault;
  int frames = 0;
  bag_.for_each({topics_.depth, topics_.camera_info, topics_.odometry},
                [&](const rosbag::MessageInstance& message, double done) {
                  if (const auto info = message.instantiate<sensor_msgs::CameraInfo>()) {
                    camera = raw_camera_from(*info);
                  } else if (const auto odometry = message.instantiate<nav_msgs::Odometry>()) {
                    if (visitor.odometry)
                      visitor.odometry(odometry->header.stamp.toSec(), pose2_from(odometry->pose.pose));
                  } else if (const auto image = message.instantiate<sensor_msgs::Image>()) {
                    if (!camera.raw.valid()) return;  // the first image may come before its camera_info
                    if (!view_depth(*image, &view, &fault)) throw UserError(bag_.path() + ": " + fault);
                    if (!corrector_.correct(view, camera, &depth_m))
                      throw UserError(bag_.path() + ": " + corrector_.fault());
                    if (visitor.frame) visitor.frame(depth_m, camera.rectified, image->header.stamp.toSec());
                    progress.update(done, fmt::format("{} frames", ++frames));
                  } else {
                    throw UserError(
                        fmt::format("{}: topic '{}' has type {}, which is none of Image, CameraInfo and "
                                    "Odometry.",
                                    bag_.path(), message.getTopic(), message.getDataType()));
                  }
                });
  if (frames == 0) {
    throw UserError(
        fmt::format("{}: no depth image follows a usable '{}'.", bag_.path(), topics_.camera_info));
  }
}

}  // namespace knav
