#pragma once

#include <kinect_nav/MotionEstimate.h>
#include <nav_msgs/OccupancyGrid.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_ros/transform_broadcaster.h>

#include <memory>

#include "tsdf_local_mapper/local_mapper.h"

namespace knav {

/// Everything the mapper tells the graph after a frame. Scans, maps and clouds are made only while someone
/// listens.
class LocalMapperPublisher {
 public:
  LocalMapperPublisher(ros::NodeHandle& node, const LocalMapperRosConfig& config);

  /// After an accepted frame.
  void publish(const LocalMapper& mapper);

 private:
  void publish_motion(const LocalMapperResult& result, const ros::Time& stamp);
  void publish_transform(const LocalMapperResult& result, const ros::Time& stamp);
  void publish_particles(const LocalMapper& mapper, const ros::Time& stamp);
  /// True at most `rate` times a second of the frames' clock.
  static bool due(double stamp_s, double rate_hz, double* last_s);

  LocalMapperRosConfig config_;
  ros::Publisher scan_, map_, motion_, particles_;
  tf2_ros::TransformBroadcaster broadcaster_;
  RangeScan scan_360_;
  OccupancyGrid local_map_;
  bool have_last_ = false;
  double last_stamp_s_ = 0.0;
  std::uint32_t last_epoch_ = 0;
  Pose2 last_T_local_base_;
  double last_map_s_ = -1e18, last_particles_s_ = -1e18;
};

}  // namespace knav
