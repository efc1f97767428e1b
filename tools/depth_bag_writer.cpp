#include "tools/depth_bag_writer.h"

#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <tf2_msgs/TFMessage.h>

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "ros_common/conversions.h"

namespace knav {
namespace {

geometry_msgs::Transform transform_of(const Eigen::Isometry3d& T) {
  geometry_msgs::Transform transform;
  const Eigen::Quaterniond q(T.linear());
  transform.translation.x = T.translation().x();
  transform.translation.y = T.translation().y();
  transform.translation.z = T.translation().z();
  transform.rotation.x = q.x();
  transform.rotation.y = q.y();
  transform.rotation.z = q.z();
  transform.rotation.w = q.w();
  return transform;
}

geometry_msgs::TransformStamped stamped(const char* parent, const char* child, ros::Time stamp,
                                        const geometry_msgs::Transform& transform) {
  geometry_msgs::TransformStamped message;
  message.header.stamp = stamp;
  message.header.frame_id = parent;
  message.child_frame_id = child;
  message.transform = transform;
  return message;
}

Eigen::Isometry3d camera_from_optical() {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return T;
}

}  // namespace

void DepthBagWriter::mount(double stamp_s) {
  tf2_msgs::TFMessage message;
  message.transforms.push_back(stamped("camera_link", "camera_depth_optical_frame", ros::Time(stamp_s),
                                       transform_of(camera_from_optical())));
  bag_.write("/tf_static", ros::Time(stamp_s), message);
}

void DepthBagWriter::pose(double stamp_s, const Eigen::Isometry3d& T_world_optical) {
  const ros::Time stamp(stamp_s);
  const Eigen::Vector3d position = T_world_optical.translation(), forward = T_world_optical.linear().col(2);
  const Pose2 T_world_base = {position.x(), position.y(), std::atan2(forward.y(), forward.x())};
  if (!started_) {
    T_odom_world_ = T_world_base.inverse();  // odometry starts at zero
    started_ = true;
  }
  const Pose2 T_odom_base = T_odom_world_ * T_world_base;
  nav_msgs::Odometry odometry;
  odometry.header.stamp = stamp;
  odometry.child_frame_id = "base_link";
  odometry.header.frame_id = "world";
  odometry.pose.pose = pose_message(T_world_base);
  bag_.write("/ground_truth", stamp, odometry);
  odometry.header.frame_id = "odom";
  odometry.pose.pose = pose_message(T_odom_base);
  bag_.write("/odom", stamp, odometry);

  Eigen::Isometry3d T_base_world = Eigen::Isometry3d::Identity();
  T_base_world.linear() =
      Eigen::AngleAxisd(-T_world_base.yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  T_base_world.translation() = T_base_world.linear() * Eigen::Vector3d(-position.x(), -position.y(), 0.0);
  tf2_msgs::TFMessage tf;
  tf.transforms.push_back(stamped("odom", "base_link", stamp, transform_message(T_odom_base)));
  tf.transforms.push_back(
      stamped("base_link", "camera_link", stamp,
              transform_of(T_base_world * T_world_optical * camera_from_optical().inverse())));
  bag_.write("/tf", stamp, tf);
}

void DepthBagWriter::frame(double stamp_s, const PinholeModel& camera, const cv::Mat& depth_mm) {
  const ros::Time stamp(stamp_s);
  info_.header.stamp = image_.header.stamp = stamp;
  info_.header.frame_id = image_.header.frame_id = "camera_depth_optical_frame";
  info_.width = image_.width = static_cast<std::uint32_t>(camera.width_px);
  info_.height = image_.height = static_cast<std::uint32_t>(camera.height_px);
  info_.distortion_model = "plumb_bob";
  info_.D.assign(5, 0.0);
  info_.K = {camera.fx_px, 0.0, camera.cx_px, 0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 1.0};
  info_.R = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  info_.P = {camera.fx_px, 0.0, camera.cx_px, 0.0, 0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 0.0, 1.0, 0.0};
  image_.encoding = "16UC1";
  image_.step = image_.width * 2;
  image_.data.resize(static_cast<std::size_t>(image_.step) * image_.height);
  depth_mm.copyTo(cv::Mat(depth_mm.rows, depth_mm.cols, CV_16UC1, image_.data.data(), image_.step));
  bag_.write("/camera/depth/camera_info", stamp, info_);
  bag_.write("/camera/depth/image_raw", stamp, image_);
}

}  // namespace knav
