#include "kinect_sim/sim_messages.h"

#include "ros_common/conversions.h"

namespace knav {
namespace {

geometry_msgs::TransformStamped transform(const std::string& parent, const std::string& child,
                                          const Eigen::Isometry3d& T, double stamp_s) {
  geometry_msgs::TransformStamped message;
  message.header.stamp.fromSec(stamp_s);
  message.header.frame_id = parent;
  message.child_frame_id = child;
  const Eigen::Quaterniond q(T.linear());
  message.transform.translation.x = T.translation().x();
  message.transform.translation.y = T.translation().y();
  message.transform.translation.z = T.translation().z();
  message.transform.rotation.x = q.x();
  message.transform.rotation.y = q.y();
  message.transform.rotation.z = q.z();
  message.transform.rotation.w = q.w();
  return message;
}

}  // namespace

sensor_msgs::CameraInfo camera_info_message(const PinholeModel& camera, double stamp_s) {
  sensor_msgs::CameraInfo info;
  info.header.stamp.fromSec(stamp_s);
  info.header.frame_id = kOpticalFrame;
  info.width = static_cast<std::uint32_t>(camera.width_px);
  info.height = static_cast<std::uint32_t>(camera.height_px);
  info.distortion_model = "plumb_bob";
  info.D.assign(5, 0.0);
  info.K = {camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1};
  info.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.P = {camera.fx_px, 0, camera.cx_px, 0, 0, camera.fy_px, camera.cy_px, 0, 0, 0, 1, 0};
  return info;
}

void prepare_depth_message(const PinholeModel& camera, sensor_msgs::Image* message) {
  message->header.frame_id = kOpticalFrame;
  message->width = static_cast<std::uint32_t>(camera.width_px);
  message->height = static_cast<std::uint32_t>(camera.height_px);
  message->encoding = "16UC1";
  message->is_bigendian = 0;
  message->step = message->width * 2;
  message->data.resize(message->step * message->height);
}

cv::Mat depth_view(sensor_msgs::Image* message) {
  return cv::Mat(static_cast<int>(message->height), static_cast<int>(message->width), CV_16UC1,
                 message->data.data(), message->step);
}

nav_msgs::Odometry odometry_message(const Simulator& simulator) {
  nav_msgs::Odometry message;
  message.header.stamp.fromSec(simulator.stamp_s());
  message.header.frame_id = "odom";
  message.child_frame_id = "base_link";
  message.pose.pose = pose_message(simulator.T_odom_base());
  message.twist.twist.linear.x = simulator.robot().odometry_v_mps();
  message.twist.twist.angular.z = simulator.robot().odometry_w_radps();
  for (const std::size_t i : {0u, 7u}) message.pose.covariance[i] = message.twist.covariance[i] = 1e-3;
  for (const std::size_t i : {14u, 21u, 28u}) message.pose.covariance[i] = message.twist.covariance[i] = 1e6;
  message.pose.covariance[35] = message.twist.covariance[35] = 1e-2;
  return message;
}

geometry_msgs::TransformStamped odometry_transform(const Simulator& simulator) {
  geometry_msgs::TransformStamped message;
  message.header.stamp.fromSec(simulator.stamp_s());
  message.header.frame_id = "odom";
  message.child_frame_id = "base_link";
  message.transform = transform_message(simulator.T_odom_base());
  return message;
}

nav_msgs::Odometry ground_truth_message(const Simulator& simulator) {
  nav_msgs::Odometry message;
  message.header.stamp.fromSec(simulator.stamp_s());
  message.header.frame_id = "world";
  message.child_frame_id = "base_link";
  message.pose.pose = pose_message(simulator.T_world_base());
  message.twist.twist.linear.x = simulator.robot().v_mps();
  message.twist.twist.angular.z = simulator.robot().w_radps();
  return message;
}

std::vector<geometry_msgs::TransformStamped> mount_transforms(const Simulator& simulator) {
  const Eigen::Isometry3d T_base_camera = simulator.T_base_camera();
  const Eigen::Isometry3d T_camera_optical = T_base_camera.inverse() * simulator.T_base_optical();
  const Pose2 laser = simulator.T_base_laser();
  Eigen::Isometry3d T_base_laser = Eigen::Isometry3d::Identity();
  T_base_laser.translation() << laser.x_m, laser.y_m, simulator.config().laser_height_m;
  const double stamp_s = simulator.stamp_s();
  return {transform("base_link", "camera_link", T_base_camera, stamp_s),
          transform("camera_link", kOpticalFrame, T_camera_optical, stamp_s),
          transform("base_link", "laser", T_base_laser, stamp_s)};
}

sensor_msgs::Range range_message(Simulator& simulator, const FrameRequest& request) {
  sensor_msgs::Range message;
  message.header.stamp.fromSec(request.stamp_s);
  message.header.frame_id = kOpticalFrame;
  message.radiation_type = sensor_msgs::Range::INFRARED;
  message.field_of_view = 0.001f;
  message.min_range = 0.05f;
  message.max_range = 50.0f;
  message.range = simulator.range_ahead_m(request);
  return message;
}

visualization_msgs::MarkerArray people_message(const Simulator& simulator) {
  visualization_msgs::MarkerArray message;
  // Relative to the robot: the world's frame is nowhere in TF, so that nobody navigates by it.
  const Pose2 T_base_world = simulator.T_world_base().inverse();
  for (const PersonState& person : simulator.people()) {
    visualization_msgs::Marker marker;
    marker.header.stamp.fromSec(simulator.stamp_s());
    marker.header.frame_id = "base_link";
    marker.ns = "people";
    marker.id = static_cast<int>(message.markers.size());
    marker.type = visualization_msgs::Marker::CYLINDER;
    marker.pose = pose_message(T_base_world * person.T_world_person);
    marker.pose.position.z = person.height_m / 2;
    marker.scale.x = marker.scale.y = 2 * person.radius_m;
    marker.scale.z = person.height_m;
    marker.color.r = 0.9f;
    marker.color.g = 0.5f;
    marker.color.b = 0.1f;
    marker.color.a = 0.8f;
    message.markers.push_back(marker);
  }
  return message;
}

}  // namespace knav
