#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Range.h>
#include <visualization_msgs/MarkerArray.h>

#include "kinect_sim/simulator.h"

namespace knav {

/// The simulator's state as messages, the same live and in recordings.
constexpr char kOpticalFrame[] = "camera_depth_optical_frame";

sensor_msgs::CameraInfo camera_info_message(const PinholeModel& camera, double stamp_s);
/// header and layout for a 16UC1 image whose data are to be filled in place.
void prepare_depth_message(const PinholeModel& camera, sensor_msgs::Image* message);
cv::Mat depth_view(sensor_msgs::Image* message);

nav_msgs::Odometry odometry_message(const Simulator& simulator);
geometry_msgs::TransformStamped odometry_transform(const Simulator& simulator);
nav_msgs::Odometry ground_truth_message(const Simulator& simulator);
/// base_link -> camera_link -> camera_depth_optical_frame, and base_link -> laser
std::vector<geometry_msgs::TransformStamped> mount_transforms(const Simulator& simulator);
/// A single-point laser beside the camera, looking along its axis: the calibrator's truth.
sensor_msgs::Range range_message(Simulator& simulator, const FrameRequest& request);
visualization_msgs::MarkerArray people_message(const Simulator& simulator);

}  // namespace knav
