#include "ros_common/conversions.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "core/error.h"

namespace knav {
namespace {

double yaw_of(const geometry_msgs::Quaternion& q) {
  return std::atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z));
}

geometry_msgs::Quaternion quaternion_of(double yaw_rad) {
  geometry_msgs::Quaternion q;
  q.z = std::sin(yaw_rad / 2.0);
  q.w = std::cos(yaw_rad / 2.0);
  return q;
}

}  // namespace

Pose2 pose2_from(const geometry_msgs::Pose& pose) {
  return {pose.position.x, pose.position.y, yaw_of(pose.orientation)};
}

Pose2 pose2_from(const geometry_msgs::Transform& transform) {
  return {transform.translation.x, transform.translation.y, yaw_of(transform.rotation)};
}

geometry_msgs::Pose pose_message(const Pose2& pose) {
  geometry_msgs::Pose message;
  message.position.x = pose.x_m;
  message.position.y = pose.y_m;
  message.orientation = quaternion_of(pose.yaw_rad);
  return message;
}

geometry_msgs::Transform transform_message(const Pose2& transform) {
  geometry_msgs::Transform message;
  message.translation.x = transform.x_m;
  message.translation.y = transform.y_m;
  message.rotation = quaternion_of(transform.yaw_rad);
  return message;
}

Pose2 planar_camera_pose(const geometry_msgs::Transform& T_base_optical) {
  const auto& q = T_base_optical.rotation;
  const Eigen::Vector3d forward = Eigen::Quaterniond(q.w, q.x, q.y, q.z) * Eigen::Vector3d::UnitZ();
  return {T_base_optical.translation.x, T_base_optical.translation.y, std::atan2(forward.y(), forward.x())};
}

PinholeModel pinhole_from(const sensor_msgs::CameraInfo& info) {
  PinholeModel model;
  model.width_px = static_cast<int>(info.width);
  model.height_px = static_cast<int>(info.height);
  const bool has_projection = info.P[0] > 0.0;
  model.fx_px = has_projection ? info.P[0] : info.K[0];
  model.fy_px = has_projection ? info.P[5] : info.K[4];
  model.cx_px = has_projection ? info.P[2] : info.K[2];
  model.cy_px = has_projection ? info.P[6] : info.K[5];
  return model;
}

void profile_from(const kinect_nav::DepthProfile& message, DepthProfile* profile) {
  const std::size_t columns = message.z.size();
  if (message.free_from.size() != columns || message.free_to.size() != columns ||
      message.height_class.size() != columns || (!message.rows.empty() && message.rows.size() != columns)) {
    throw UserError("depth profile: z, free_from, free_to, height_class and, unless it is empty, rows must have the same length.");
  }
  profile->stamp_s = message.header.stamp.toSec();
  profile->fx_px = message.fx;
  profile->cx_px = message.cx;
  profile->camera_height_m = message.camera_height_m;
  profile->range_max_m = message.range_max_m;
  profile->z_m = message.z;
  profile->free_from_m = message.free_from;
  profile->free_to_m = message.free_to;
  profile->height_class.resize(columns);
  for (std::size_t i = 0; i < columns; ++i) {
    profile->height_class[i] = static_cast<HeightClass>(message.height_class[i]);
  }
  profile->rows = message.rows;
}

void profile_message(const DepthProfile& profile, kinect_nav::DepthProfile* message) {
  message->header.stamp = ros::Time(profile.stamp_s);
  message->fx = static_cast<float>(profile.fx_px);
  message->cx = static_cast<float>(profile.cx_px);
  message->camera_height_m = static_cast<float>(profile.camera_height_m);
  message->range_max_m = static_cast<float>(profile.range_max_m);
  message->z = profile.z_m;
  message->free_from = profile.free_from_m;
  message->free_to = profile.free_to_m;
  message->height_class.resize(profile.height_class.size());
  for (std::size_t i = 0; i < profile.height_class.size(); ++i) {
    message->height_class[i] = static_cast<std::uint8_t>(profile.height_class[i]);
  }
  message->rows = profile.rows;
}

void distance_map_message(const DistanceMap& map, kinect_nav::DistanceMap* message) {
  message->info = metadata_from(map.geometry);
  message->checksum = map.checksum;
  message->distance = map.distance_m;
}

DistanceMap distance_map_from(const kinect_nav::DistanceMap& message) {
  DistanceMap map;
  map.geometry = geometry_from(message.info);
  map.checksum = message.checksum;
  map.distance_m = message.distance;
  if (map.distance_m.size() != map.geometry.cell_count()) {
    throw UserError("distance map: the number of values is not width x height.");
  }
  return map;
}

void scan_from(const sensor_msgs::LaserScan& message, RangeScan* scan) {
  scan->stamp_s = message.header.stamp.toSec();
  scan->angle_min_rad = message.angle_min;
  scan->angle_increment_rad = message.angle_increment;
  scan->range_min_m = message.range_min;
  scan->range_max_m = message.range_max;
  scan->range_m.resize(message.ranges.size());
  for (std::size_t i = 0; i < message.ranges.size(); ++i) {
    const float range = message.ranges[i];
    scan->range_m[i] = range >= message.range_max   ? std::numeric_limits<float>::infinity()
                       : range >= message.range_min ? range
                                                    : std::numeric_limits<float>::quiet_NaN();
  }
  scan->evidence.clear();
  if (message.intensities.size() == message.ranges.size()) scan->evidence = message.intensities;
}

void scan_message(const RangeScan& scan, sensor_msgs::LaserScan* message) {
  message->header.stamp = ros::Time(scan.stamp_s);
  message->angle_min = static_cast<float>(scan.angle_min_rad);
  message->angle_increment = static_cast<float>(scan.angle_increment_rad);
  const double last = static_cast<double>(scan.range_m.empty() ? 0 : scan.range_m.size() - 1);
  message->angle_max = static_cast<float>(scan.angle_min_rad + scan.angle_increment_rad * last);
  message->range_min = static_cast<float>(scan.range_min_m);
  message->range_max = static_cast<float>(scan.range_max_m);
  message->ranges = scan.range_m;
  message->intensities = scan.evidence;
}

void occupancy_message(const OccupancyGrid& grid, nav_msgs::OccupancyGrid* message) {
  message->info = metadata_from(grid.geometry);
  message->data = grid.value;
}

OccupancyGrid occupancy_from(const nav_msgs::OccupancyGrid& message) {
  OccupancyGrid grid;
  grid.geometry = geometry_from(message.info);
  grid.value = message.data;
  if (grid.value.size() != grid.geometry.cell_count()) {
    throw UserError("occupancy grid: the number of values is not width x height.");
  }
  return grid;
}

GridGeometry geometry_from(const nav_msgs::MapMetaData& info) {
  GridGeometry geometry;
  geometry.width_cells = static_cast<int>(info.width);
  geometry.height_cells = static_cast<int>(info.height);
  geometry.resolution_m = info.resolution;
  geometry.origin_x_m = info.origin.position.x;
  geometry.origin_y_m = info.origin.position.y;
  return geometry;
}

nav_msgs::MapMetaData metadata_from(const GridGeometry& geometry) {
  nav_msgs::MapMetaData info;
  info.width = static_cast<std::uint32_t>(geometry.width_cells);
  info.height = static_cast<std::uint32_t>(geometry.height_cells);
  info.resolution = static_cast<float>(geometry.resolution_m);
  info.origin = pose_message({geometry.origin_x_m, geometry.origin_y_m, 0.0});
  return info;
}

}  // namespace knav
