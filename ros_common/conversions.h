#pragma once

#include <geometry_msgs/Pose.h>
#include <geometry_msgs/Transform.h>
#include <kinect_nav/DepthProfile.h>
#include <kinect_nav/DistanceMap.h>
#include <nav_msgs/OccupancyGrid.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/LaserScan.h>

#include "core/camera_model.h"
#include "core/depth_profile.h"
#include "core/distance_map.h"
#include "core/grid_geometry.h"
#include "core/pose2.h"
#include "core/range_scan.h"

namespace knav {

Pose2 pose2_from(const geometry_msgs::Pose& pose);
Pose2 pose2_from(const geometry_msgs::Transform& transform);
geometry_msgs::Pose pose_message(const Pose2& pose);
geometry_msgs::Transform transform_message(const Pose2& transform);

/// A levelled camera's pose in the plane from its optical frame's full transform to the base (z forward becomes
/// the pose's x).
Pose2 planar_camera_pose(const geometry_msgs::Transform& T_base_optical);

/// P of a rectified camera_info; K if P is empty.
PinholeModel pinhole_from(const sensor_msgs::CameraInfo& info);

/// UserError if the arrays differ in length.
void profile_from(const kinect_nav::DepthProfile& message, DepthProfile* profile);
/// header.frame_id is left to the caller.
void profile_message(const DepthProfile& profile, kinect_nav::DepthProfile* message);

void distance_map_message(const DistanceMap& map, kinect_nav::DistanceMap* message);
DistanceMap distance_map_from(const kinect_nav::DistanceMap& message);

/// Readings below range_min become NaN (too near to measure). Readings at or above range_max, which drivers older
/// than REP 117 send for "nothing there", become +Inf.
void scan_from(const sensor_msgs::LaserScan& message, RangeScan* scan);
/// header.frame_id is left to the caller; intensities carry the evidence.
void scan_message(const RangeScan& scan, sensor_msgs::LaserScan* message);

void occupancy_message(const OccupancyGrid& grid, nav_msgs::OccupancyGrid* message);
OccupancyGrid occupancy_from(const nav_msgs::OccupancyGrid& message);
GridGeometry geometry_from(const nav_msgs::MapMetaData& info);
nav_msgs::MapMetaData metadata_from(const GridGeometry& geometry);

}  // namespace knav
