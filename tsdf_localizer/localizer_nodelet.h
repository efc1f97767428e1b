#pragma once

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <kinect_nav/DistanceMap.h>
#include <kinect_nav/LocalizationStatus.h>
#include <kinect_nav/MotionEstimate.h>
#include <nav_msgs/OccupancyGrid.h>
#include <nav_msgs/SetMap.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <std_srvs/Empty.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <memory>
#include <string>

#include "ros_common/clock_watch.h"
#include "ros_common/late_transforms.h"
#include "ros_common/nodelet_base.h"
#include "tsdf_localizer/localizer.h"
#include "tsdf_localizer/localizer_diagnostics.h"
#include "tsdf_localizer/localizer_node_config.h"
#include "tsdf_localizer/map_odom_broadcaster.h"
#include "tsdf_localizer/saved_pose.h"
#include "tsdf_localizer/scan_inbox.h"

namespace knav {

/// Monte Carlo localization with amcl's interface (docs/localization.md). All callbacks run on the nodelet's
/// one queue, so nothing is locked.
class LocalizerNodelet : public NodeletBase {
 public:
  ~LocalizerNodelet() override;

 protected:
  void start() override;

 private:
  void on_scan(const sensor_msgs::LaserScanConstPtr& scan);
  void on_motion(const kinect_nav::MotionEstimateConstPtr& motion);
  void on_distance_map(const kinect_nav::DistanceMapConstPtr& map);
  void on_map(const nav_msgs::OccupancyGridConstPtr& map);
  void on_initial_pose(const geometry_msgs::PoseWithCovarianceStampedConstPtr& pose);
  bool on_set_map(nav_msgs::SetMap::Request& request, nav_msgs::SetMap::Response& response);
  void on_timer();

  bool take_map(const DistanceMap& map, const std::string& source);
  bool take_pose(const geometry_msgs::PoseWithCovarianceStamped& pose, const std::string& source);
  void begin();
  bool clock_jumped_back(double now_s);
  void process_scans();
  void process(const ScanInput& input);
  void publish(const LocalizerResult& result);
  void publish_status(const LocalizerResult& result);
  void log_verdict(const LocalizerResult& result);
  void correct(const LocalizerResult& result, const Pose2& T_odom_base);
  void remember_pose(double now_s, bool at_end);

  LocalizerNodeConfig config_;
  std::unique_ptr<Localizer> localizer_;
  tf2_ros::Buffer tf_;
  LateTransforms late_transforms_{tf_};
  std::unique_ptr<tf2_ros::TransformListener> listener_;
  std::unique_ptr<MapOdomBroadcaster> broadcaster_;
  std::unique_ptr<ScanInbox> inbox_;
  std::unique_ptr<LocalizerDiagnostics> diagnostics_;
  ClockWatch scan_clock_, timer_clock_;

  ros::Subscriber scan_sub_, motion_sub_, distance_map_sub_, map_sub_, initial_pose_sub_;
  ros::Publisher pose_pub_, cloud_pub_, status_pub_;
  ros::ServiceServer global_srv_, nomotion_srv_, set_map_srv_;
  ros::WallTimer timer_;

  RangeScan scan_;
  bool has_distance_map_ = false;
  std::string checksum_, saved_pose_file_;
  Pose2 T_map_base_saved_;
  bool has_saved_ = false;
  double saved_s_ = 0.0;
  double position_sd_m_ = 0.0, yaw_sd_rad_ = 0.0;  ///< when map->odom was last corrected
  LocalizationVerdict last_verdict_ = LocalizationVerdict::kInitializing;
  ros::WallTime last_scan_wall_, last_cloud_wall_, last_status_wall_;
};

}  // namespace knav
