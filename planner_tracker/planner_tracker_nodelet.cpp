#include "planner_tracker/planner_tracker_nodelet.h"

#include <geometry_msgs/Twist.h>
#include <kinect_nav/NavigationFailure.h>
#include <nav_msgs/Path.h>
#include <std_msgs/String.h>

#include <cmath>
#include <pluginlib/class_list_macros.hpp>

#include "core/error.h"
#include "ros_common/conversions.h"
#include "ros_common/parameters.h"

namespace knav {
namespace {

/// Map, distance map and keepout come as three messages of one load: they are taken together after this
/// silence.
constexpr double kMapSettles_s = 0.3;
/// An overlay of 20 x 20 m takes 4 ms: not at every frame of the mapper.
constexpr double kOverlayEvery_s = 0.14;

nav_msgs::Path path_message(const std::vector<Point2>& points, const std::string& frame,
                            const ros::Time& stamp, const Pose2* end) {
  nav_msgs::Path path;
  path.header.frame_id = frame;
  path.header.stamp = stamp;
  for (std::size_t i = 0; i < points.size(); ++i) {
    double yaw = end ? end->yaw_rad : 0.0;
    if (i + 1 < points.size())
      yaw = std::atan2(points[i + 1].y_m - points[i].y_m, points[i + 1].x_m - points[i].x_m);
    geometry_msgs::PoseStamped pose;
    pose.header = path.header;
    pose.pose = pose_message({points[i].x_m, points[i].y_m, yaw});
    path.poses.push_back(pose);
  }
  return path;
}

}  // namespace

PlannerTrackerNodelet::PlannerTrackerNodelet() = default;

PlannerTrackerNodelet::~PlannerTrackerNodelet() {
  if (spinner_) spinner_->stop();
  if (moving_) stop_base();
}

void PlannerTrackerNodelet::start() {
  config_ = read_parameters<PlannerTrackerConfig>(getPrivateNodeHandle());
  planner_ = std::make_unique<PlannerTracker>(config_);
  ros::NodeHandle nh(getNodeHandle());
  nh.setCallbackQueue(&queue_);
  tf_listener_ = std::make_unique<tf2_ros::TransformListener>(tf_);
  advertise(nh);
  subscribe(nh);
  offer_action();
  control_timer_ = nh.createTimer(ros::Duration(1.0 / config_.controller_frequency),
                                  &PlannerTrackerNodelet::control, this);
  costmap_timer_ = nh.createTimer(ros::Duration(1.0), &PlannerTrackerNodelet::publish_costmap, this);
  spinner_ = std::make_unique<ros::AsyncSpinner>(1, &queue_);
  spinner_->start();
}

void PlannerTrackerNodelet::offer_action() {
  action_.reset();
  ros::NodeHandle nh(getNodeHandle());
  nh.setCallbackQueue(&queue_);
  action_ = std::make_unique<ActionServer>(nh, "move_base", false);
  action_->registerGoalCallback([this] { on_goal(); });
  action_->registerPreemptCallback([this] { on_preempt(); });
  action_->start();
}

void PlannerTrackerNodelet::advertise(ros::NodeHandle& nh) {
  cmd_vel_pub_ = nh.advertise<geometry_msgs::Twist>("cmd_vel", 1);
  plan_pub_ = nh.advertise<nav_msgs::Path>("plan", 1);
  failure_pub_ = nh.advertise<kinect_nav::NavigationFailure>("navigation_failure", 1);
  costmap_pub_ = nh.advertise<nav_msgs::OccupancyGrid>("costmap", 1);
  activity_pub_ = nh.advertise<std_msgs::String>("navigation_activity", 5, true);
  action_goal_pub_ = nh.advertise<move_base_msgs::MoveBaseActionGoal>("move_base/goal", 1);
  make_plan_srv_ = nh.advertiseService("move_base/make_plan", &PlannerTrackerNodelet::on_make_plan, this);
  clear_srv_ =
      nh.advertiseService("move_base/clear_costmaps", &PlannerTrackerNodelet::on_clear_costmaps, this);
  go_to_srv_ = nh.advertiseService("go_to", &PlannerTrackerNodelet::on_go_to, this);
}

void PlannerTrackerNodelet::subscribe(ros::NodeHandle& nh) {
  map_sub_ = nh.subscribe("map", 1, &PlannerTrackerNodelet::on_map, this);
  distance_sub_ = nh.subscribe("distance_map", 1, &PlannerTrackerNodelet::on_distance_map, this);
  keepout_sub_ = nh.subscribe("keepout_map", 1, &PlannerTrackerNodelet::on_keepout, this);
  local_sub_ = nh.subscribe<nav_msgs::OccupancyGrid>(
      "local_map", 1, [this](const nav_msgs::OccupancyGrid::ConstPtr& message) { local_ = message; });
  scan_sub_ =
      nh.subscribe("scan_360", 1, &PlannerTrackerNodelet::on_scan, this, ros::TransportHints().tcpNoDelay());
  odom_sub_ =
      nh.subscribe("odom", 20, &PlannerTrackerNodelet::on_odometry, this, ros::TransportHints().tcpNoDelay());
  status_sub_ = nh.subscribe("localization_status", 1, &PlannerTrackerNodelet::on_status, this);
  goal_sub_ = nh.subscribe("move_base_simple/goal", 1, &PlannerTrackerNodelet::on_simple_goal, this);
}

void PlannerTrackerNodelet::on_map(const nav_msgs::OccupancyGrid::ConstPtr& message) {
  map_ = message;
  map_changed_ = ros::Time::now();
  map_dirty_ = true;
}

void PlannerTrackerNodelet::on_distance_map(const kinect_nav::DistanceMap::ConstPtr& message) {
  distance_ = message;
  map_changed_ = ros::Time::now();
  map_dirty_ = true;
}

void PlannerTrackerNodelet::on_keepout(const nav_msgs::OccupancyGrid::ConstPtr& message) {
  keepout_ = message;
  map_changed_ = ros::Time::now();
  map_dirty_ = true;
}

void PlannerTrackerNodelet::rebuild_map() {
  const ros::Time now = ros::Time::now();
  // A clock that jumped back must not delay this for ever.
  if (!map_dirty_ || std::abs((now - map_changed_).toSec()) < kMapSettles_s) return;
  map_dirty_ = false;
  try {
    planner_->set_map(distance_ ? distance_map_from(*distance_) : DistanceMap{},
                      map_ ? occupancy_from(*map_) : OccupancyGrid{},
                      keepout_ ? occupancy_from(*keepout_) : OccupancyGrid{});
    NODELET_INFO("Map taken: %d x %d cells.", planner_->map().global().geometry.width_cells,
                 planner_->map().global().geometry.height_cells);
  } catch (const UserError& error) {
    // Maps of two different loads: the keepout is safety, so without it nothing is driven.
    NODELET_ERROR_THROTTLE(5.0, "planner_tracker: %s Keeping the previous map.", error.what());
  }
}

void PlannerTrackerNodelet::on_scan(const sensor_msgs::LaserScan::ConstPtr& message) {
  const auto known = sensor_pose_.find(message->header.frame_id);
  Pose2 T_base_sensor;
  if (known != sensor_pose_.end()) {
    T_base_sensor = known->second;
  } else if (message->header.frame_id == config_.robot_base_frame) {
    sensor_pose_[message->header.frame_id] = T_base_sensor;
  } else {
    if (!transform(config_.robot_base_frame, message->header.frame_id, ros::Time(0), &T_base_sensor,
                   nullptr)) {
      NODELET_WARN_THROTTLE(5.0, "No transform from %s to %s yet; scans are ignored.",
                            message->header.frame_id.c_str(), config_.robot_base_frame.c_str());
      return;
    }
    sensor_pose_[message->header.frame_id] = T_base_sensor;
  }
  scan_from(*message, &scan_);
  planner_->set_scan(scan_, T_base_sensor);
}

void PlannerTrackerNodelet::on_odometry(const nav_msgs::Odometry::ConstPtr& message) {
  robot_.odom_stamp_s = message->header.stamp.toSec();
  robot_.T_odom_base = pose2_from(message->pose.pose);
  robot_.v_mps = message->twist.twist.linear.x;
  robot_.w_radps = message->twist.twist.angular.z;
}

void PlannerTrackerNodelet::on_status(const kinect_nav::LocalizationStatus::ConstPtr& message) {
  using Status = kinect_nav::LocalizationStatus;
  robot_.localization_stamp_s = ros::Time::now().toSec();
  robot_.localization = message->status == Status::OK          ? LocalizationState::kOk
                        : message->status == Status::UNCERTAIN ? LocalizationState::kUncertain
                        : message->status == Status::LOST      ? LocalizationState::kLost
                                                               : LocalizationState::kInitializing;
}

bool PlannerTrackerNodelet::transform(const std::string& target, const std::string& source, ros::Time stamp,
                                      Pose2* T, ros::Time* at) {
  try {
    const auto found = tf_.lookupTransform(target, source, stamp);
    *T = pose2_from(found.transform);
    if (at) *at = found.header.stamp;
    return true;
  } catch (const tf2::TransformException&) {
    return false;
  }
}

void PlannerTrackerNodelet::overlay_local_map() {
  const ros::Time now = ros::Time::now();
  if (!local_ || planner_->map().empty() || std::abs((now - overlaid_).toSec()) < kOverlayEvery_s) return;
  Pose2 T_map_local;
  if (!transform(config_.global_frame, local_->header.frame_id, local_->header.stamp, &T_map_local,
                 nullptr)) {
    // Not there yet: asked again at the next step, but an old one is no use.
    if ((ros::Time::now() - local_->header.stamp).toSec() > 1.0) local_.reset();
    return;
  }
  overlaid_ = now;
  try {
    planner_->set_local_map(occupancy_from(*local_), T_map_local);
  } catch (const UserError& error) {
    NODELET_WARN_THROTTLE(5.0, "local_map: %s", error.what());
  }
  local_.reset();
}

void PlannerTrackerNodelet::look_up_robot() {
  // The localizer's part is post-dated; the newest common stamp is that of the base's odometry.
  ros::Time at;
  Pose2 T;
  if (!transform(config_.global_frame, config_.robot_base_frame, ros::Time(0), &T, &at)) return;
  robot_.has_pose = true;
  robot_.T_map_base = T;
  robot_.pose_stamp_s = at.toSec();
}

void PlannerTrackerNodelet::control(const ros::TimerEvent&) {
  const ros::Time now = ros::Time::now();
  if (clock_.jumped_back(now.toSec())) {
    robot_.has_pose = false;
    late_transforms_.clock_jumped_back();
  }
  // The action server refuses every goal with an earlier stamp than its last one: a new one knows none.
  if (late_transforms_.step() && !goal_active_) offer_action();
  rebuild_map();
  look_up_robot();
  overlay_local_map();
  const Command command = planner_->step(now.toSec(), robot_);
  if (goal_active_ || command.finished) {
    geometry_msgs::Twist twist;
    twist.linear.x = command.v_mps;
    twist.angular.z = command.w_radps;
    cmd_vel_pub_.publish(twist);
    moving_ = twist.linear.x != 0.0 || twist.angular.z != 0.0;
  } else if (moving_) {
    stop_base();
  }
  announce(command.activity);
  if (command.finished) {
    finish(command);
  } else if (goal_active_ && action_->isActive()) {
    move_base_msgs::MoveBaseFeedback feedback;
    feedback.base_position.header.frame_id = config_.global_frame;
    feedback.base_position.header.stamp = now;
    feedback.base_position.pose = pose_message(robot_.T_map_base);
    action_->publishFeedback(feedback);
  }
  if (goal_active_) publish_plan();
}

void PlannerTrackerNodelet::announce(Activity activity) {
  const std::string& why = planner_->explanation();
  if (activity == announced_ && why == explained_) return;
  const bool news = why != explained_ || activity == Activity::kAvoiding ||
                    activity == Activity::kLostTurning || activity == Activity::kLostWandering ||
                    activity == Activity::kStopped;
  announced_ = activity;
  explained_ = why;
  std_msgs::String text;
  text.data = why.empty() ? to_string(activity) : std::string(to_string(activity)) + ": " + why;
  activity_pub_.publish(text);
  if (news && activity != Activity::kFailed) NODELET_INFO("%s", text.data.c_str());
}

void PlannerTrackerNodelet::finish(const Command& command) {
  goal_active_ = false;
  move_base_msgs::MoveBaseResult result;
  if (command.activity == Activity::kReached) {
    if (action_->isActive()) action_->setSucceeded(result, "Goal reached.");
    return;
  }
  publish_failure(planner_->failure());
  NODELET_WARN("Goal failed: %s", planner_->failure().reason.c_str());
  if (action_->isActive()) action_->setAborted(result, planner_->failure().reason);
}

void PlannerTrackerNodelet::publish_failure(const Failure& failure) {
  kinect_nav::NavigationFailure message;
  message.header.frame_id = config_.global_frame;
  message.header.stamp = ros::Time::now();
  message.code = static_cast<std::uint8_t>(failure.code);
  message.reason = failure.reason;
  message.at.x = failure.at.x_m;
  message.at.y = failure.at.y_m;
  failure_pub_.publish(message);
}

void PlannerTrackerNodelet::publish_plan() {
  if (plan_pub_.getNumSubscribers() == 0) return;
  plan_pub_.publish(
      path_message(planner_->path(), config_.global_frame, ros::Time::now(), &planner_->goal()));
}

void PlannerTrackerNodelet::publish_costmap(const ros::TimerEvent&) {
  if (costmap_pub_.getNumSubscribers() == 0 || planner_->map().empty()) return;
  const MapLayer& layer = planner_->map().combined();
  nav_msgs::OccupancyGrid grid;
  grid.header.frame_id = config_.global_frame;
  grid.header.stamp = ros::Time::now();
  grid.info = metadata_from(layer.geometry);
  grid.data.resize(layer.state.size());
  // costmap_2d's values: 100 something there, 99 closed to the centre, then falling to 0 at the preferred
  // clearance.
  const double hard = config_.hard_radius_m(), preferred = config_.preferred_radius_m();
  for (std::size_t i = 0; i < grid.data.size(); ++i) {
    const double c = layer.clearance_of(layer.squared[i]);
    double value = c < hard ? 99.0 : c >= preferred ? 0.0 : 1.0 + 97.0 * (preferred - c) / (preferred - hard);
    if (layer.state[i] == CellState::kUnknown)
      value = -1.0;
    else if (layer.state[i] != CellState::kFree)
      value = 100.0;
    grid.data[i] = static_cast<std::int8_t>(value);
  }
  costmap_pub_.publish(grid);
}

void PlannerTrackerNodelet::stop_base() {
  cmd_vel_pub_.publish(geometry_msgs::Twist());
  moving_ = false;
}

}  // namespace knav

PLUGINLIB_EXPORT_CLASS(knav::PlannerTrackerNodelet, nodelet::Nodelet)
