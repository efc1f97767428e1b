#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "core/distance_map.h"
#include "core/pose2.h"

namespace knav {

/// The last pose that was ok, kept for the next start.
struct SavedPose {
  std::string map_checksum;
  Pose2 T_map_base;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// Atomic; UserError if the file cannot be written.
void save_pose(const std::string& path, const SavedPose& pose);

/// Nothing if there is no such file; UserError if there is one that makes no sense.
std::optional<SavedPose> load_saved_pose(const std::string& path);

/// The map's own checksum, or one made of its values where it has none.
std::string checksum_of(const DistanceMap& map);

/// "auto" -> $ROS_HOME/kinect_nav_pose.yaml, else ~/.ros/kinect_nav_pose.yaml; any other as it is.
std::string saved_pose_path(const std::string& parameter);

}  // namespace knav
