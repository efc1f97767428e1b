#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "core/pose2.h"
#include "global_map_builder/bag_transforms.h"
#include "kinect_calib/rectification.h"
#include "ros_common/bag_reader.h"

namespace knav {

struct ObservationReaderConfig;  // global_map_builder/observation_reader.h

/// Which of a recording's topics hold its observations and its odometry, and where on the robot the sensor
/// sits.
struct ObservationSource {
  std::string kind;  ///< "profile", "scan" or "depth"
  std::string topic, odometry_topic, base_frame;
  Eigen::Isometry3d T_base_sensor = Eigen::Isometry3d::Identity();
  Pose2 T_plane;             ///< T_base_sensor in the plane, x looking forward
  bool upside_down = false;  ///< of a scanner
  MovingTransform mount;     ///< empty if the sensor does not move against the base

  /// Moves the sensor to where its mount is at the stamp, if that moves.
  void place_sensor(double stamp_s);
};

/// UserError if the bag lacks the source, odometry or a depth camera's mount. What had to be guessed is added
/// to the warnings, one sentence each.
ObservationSource find_observation_source(const BagReader& bag, const ObservationReaderConfig& config,
                                          std::vector<std::string>* warnings);

/// The camera of the depth images. UserError if the bag does not describe it.
RawCamera find_depth_camera(const BagReader& bag, const ObservationReaderConfig& config,
                            std::vector<std::string>* warnings);

}  // namespace knav
