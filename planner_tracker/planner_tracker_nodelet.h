#pragma once

#include <actionlib/server/simple_action_server.h>
#include <geometry_msgs/PoseStamped.h>
#include <kinect_nav/DistanceMap.h>
#include <kinect_nav/GoTo.h>
#include <kinect_nav/LocalizationStatus.h>
#include <move_base_msgs/MoveBaseAction.h>
#include <nav_msgs/GetPlan.h>
#include <nav_msgs/OccupancyGrid.h>
#include <nav_msgs/Odometry.h>
#include <ros/callback_queue.h>
#include <ros/spinner.h>
#include <sensor_msgs/LaserScan.h>
#include <std_srvs/Empty.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <map>
#include <memory>
#include <string>

#include "planner_tracker/planner_tracker.h"
#include "ros_common/clock_watch.h"
#include "ros_common/late_transforms.h"
#include "ros_common/nodelet_base.h"

namespace knav {

/// move_base's interface round PlannerTracker. All callbacks and the control loop run in one thread of its
/// own: no locks, and a busy nodelet manager does not delay cmd_vel.
class PlannerTrackerNodelet : public NodeletBase {
 public:
  PlannerTrackerNodelet();
  ~PlannerTrackerNodelet() override;

 private:
  using ActionServer = actionlib::SimpleActionServer<move_base_msgs::MoveBaseAction>;

  void start() override;
  void offer_action();
  void advertise(ros::NodeHandle& nh);
  void subscribe(ros::NodeHandle& nh);

  void on_map(const nav_msgs::OccupancyGrid::ConstPtr& message);
  void on_distance_map(const kinect_nav::DistanceMap::ConstPtr& message);
  void on_keepout(const nav_msgs::OccupancyGrid::ConstPtr& message);
  void on_scan(const sensor_msgs::LaserScan::ConstPtr& message);
  void on_odometry(const nav_msgs::Odometry::ConstPtr& message);
  void on_status(const kinect_nav::LocalizationStatus::ConstPtr& message);
  void on_simple_goal(const geometry_msgs::PoseStamped::ConstPtr& message);
  void on_goal();
  void on_preempt();
  bool on_make_plan(nav_msgs::GetPlan::Request& request, nav_msgs::GetPlan::Response& response);
  bool on_clear_costmaps(std_srvs::Empty::Request&, std_srvs::Empty::Response&);
  bool on_go_to(kinect_nav::GoTo::Request& request, kinect_nav::GoTo::Response& response);

  void control(const ros::TimerEvent&);
  void rebuild_map();
  void overlay_local_map();
  void look_up_robot();
  void finish(const Command& command);
  void refuse(const std::string& reason);
  void announce(Activity activity);
  void publish_failure(const Failure& failure);
  void publish_plan();
  void publish_costmap(const ros::TimerEvent&);
  void stop_base();
  /// The goal as a plane pose in the global frame; false, with a sentence, if it is none.
  bool goal_pose(const geometry_msgs::PoseStamped& message, Pose2* T_map_goal, std::string* fault);
  bool transform(const std::string& target, const std::string& source, ros::Time stamp, Pose2* T,
                 ros::Time* at);

  PlannerTrackerConfig config_;
  std::unique_ptr<PlannerTracker> planner_;
  ros::CallbackQueue queue_;
  std::unique_ptr<ros::AsyncSpinner> spinner_;
  tf2_ros::Buffer tf_;
  LateTransforms late_transforms_{tf_};
  ClockWatch clock_;
  std::unique_ptr<tf2_ros::TransformListener> tf_listener_;
  std::unique_ptr<ActionServer> action_;
  ros::Subscriber map_sub_, distance_sub_, keepout_sub_, local_sub_, scan_sub_, odom_sub_, status_sub_,
      goal_sub_;
  ros::Publisher cmd_vel_pub_, plan_pub_, failure_pub_, costmap_pub_, activity_pub_, action_goal_pub_;
  ros::ServiceServer make_plan_srv_, clear_srv_, go_to_srv_;
  ros::Timer control_timer_, costmap_timer_;

  nav_msgs::OccupancyGrid::ConstPtr map_, keepout_, local_;
  kinect_nav::DistanceMap::ConstPtr distance_;
  ros::Time map_changed_, overlaid_;
  bool map_dirty_ = false;
  RangeScan scan_;
  std::map<std::string, Pose2> sensor_pose_;  ///< T_base_sensor by frame, looked up once
  RobotState robot_;
  bool goal_active_ = false, moving_ = false;
  Activity announced_ = Activity::kIdle;
  std::string explained_;
};

}  // namespace knav
