// The goals' side of PlannerTrackerNodelet: the action, its simple topic, and the services.
#include <cmath>

#include "core/config.h"
#include "core/error.h"
#include "planner_tracker/places.h"
#include "planner_tracker/planner_tracker_nodelet.h"
#include "ros_common/conversions.h"

namespace knav {

bool PlannerTrackerNodelet::goal_pose(const geometry_msgs::PoseStamped& message, Pose2* T_map_goal,
                                      std::string* fault) {
  const auto& p = message.pose.position;
  const auto& q = message.pose.orientation;
  if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(q.x) || !std::isfinite(q.y) ||
      !std::isfinite(q.z) || !std::isfinite(q.w)) {
    *fault = "The goal holds a value that is not a number.";
    return false;
  }
  if (std::abs(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1.0) > 0.05) {
    *fault = "The goal's quaternion is not of length 1; set orientation.w to 1 for a goal without a turn.";
    return false;
  }
  if (std::abs(q.x) > 0.1 || std::abs(q.y) > 0.1) {
    *fault = "The goal is tilted; only a turn about the vertical axis makes sense.";
    return false;
  }
  std::string frame = message.header.frame_id;
  if (!frame.empty() && frame[0] == '/') frame.erase(0, 1);
  if (frame.empty()) {
    *fault = "The goal names no frame; set header.frame_id, for example to " + config_.global_frame + ".";
    return false;
  }
  const Pose2 T_frame_goal = pose2_from(message.pose);
  if (frame == config_.global_frame) {
    *T_map_goal = T_frame_goal;
    return true;
  }
  Pose2 T_map_frame;
  if (!transform(config_.global_frame, frame, ros::Time(0), &T_map_frame, nullptr)) {
    *fault = "The goal is given in the frame '" + frame + "', which has no transform to '" +
             config_.global_frame + "'.";
    return false;
  }
  *T_map_goal = T_map_frame * T_frame_goal;
  return true;
}

void PlannerTrackerNodelet::on_goal() {
  // Taking it preempts the goal before.
  const move_base_msgs::MoveBaseGoalConstPtr goal = action_->acceptNewGoal();
  Pose2 T_map_goal;
  std::string fault;
  if (!goal_pose(goal->target_pose, &T_map_goal, &fault)) return refuse(fault);
  if (!planner_->set_goal(T_map_goal)) return refuse(planner_->failure().reason);
  goal_active_ = true;
  NODELET_INFO("Goal: (%.2f, %.2f) m, %.2f rad.", T_map_goal.x_m, T_map_goal.y_m, T_map_goal.yaw_rad);
}

void PlannerTrackerNodelet::refuse(const std::string& reason) {
  planner_->cancel();
  goal_active_ = false;
  stop_base();
  NODELET_WARN("Goal refused: %s", reason.c_str());
  Failure failure;
  failure.code = FailureCode::kGoalInvalid;
  failure.reason = reason;
  publish_failure(failure);
  action_->setAborted(move_base_msgs::MoveBaseResult(), reason);
}

void PlannerTrackerNodelet::on_preempt() {
  // A new goal also comes through here first; it takes over in on_goal().
  if (action_->isNewGoalAvailable()) return;
  planner_->cancel();
  goal_active_ = false;
  stop_base();
  NODELET_INFO("Goal cancelled; the robot stops.");
  if (action_->isActive()) action_->setPreempted(move_base_msgs::MoveBaseResult(), "Cancelled.");
}

void PlannerTrackerNodelet::on_simple_goal(const geometry_msgs::PoseStamped::ConstPtr& message) {
  // As move_base: through its own action, so that all goals are one kind.
  move_base_msgs::MoveBaseActionGoal goal;
  goal.header.stamp = ros::Time::now();
  goal.goal.target_pose = *message;
  action_goal_pub_.publish(goal);
}

bool PlannerTrackerNodelet::on_make_plan(nav_msgs::GetPlan::Request& request,
                                         nav_msgs::GetPlan::Response& response) {
  response.plan.header.frame_id = config_.global_frame;
  response.plan.header.stamp = ros::Time::now();
  Pose2 start, goal;
  std::string fault;
  if (!goal_pose(request.goal, &goal, &fault)) {
    NODELET_WARN("make_plan: %s", fault.c_str());
    return false;
  }
  if (request.start.header.frame_id.empty()) {
    if (!robot_.has_pose) {
      NODELET_WARN("make_plan: the robot's pose is not known; give a start.");
      return false;
    }
    start = robot_.T_map_base;
  } else if (!goal_pose(request.start, &start, &fault)) {
    NODELET_WARN("make_plan: start: %s", fault.c_str());
    return false;
  }
  const PlanResult result = planner_->make_plan({start.x_m, start.y_m}, {goal.x_m, goal.y_m},
                                                static_cast<double>(request.tolerance));
  for (std::size_t i = 0; i < result.path.size(); ++i) {
    const Point2& p = result.path[i];
    double yaw = goal.yaw_rad;
    if (i + 1 < result.path.size()) {
      yaw = std::atan2(result.path[i + 1].y_m - p.y_m, result.path[i + 1].x_m - p.x_m);
    }
    geometry_msgs::PoseStamped pose;
    pose.header = response.plan.header;
    pose.pose = pose_message({p.x_m, p.y_m, yaw});
    response.plan.poses.push_back(pose);
  }
  return true;
}

bool PlannerTrackerNodelet::on_clear_costmaps(std_srvs::Empty::Request&, std_srvs::Empty::Response&) {
  planner_->clear_local_map();
  return true;
}

bool PlannerTrackerNodelet::on_go_to(kinect_nav::GoTo::Request& request,
                                     kinect_nav::GoTo::Response& response) {
  response.accepted = false;
  if (config_.places_file.empty()) {
    response.message =
        "No places are known: set the parameter places_file to a places.yaml or a map directory.";
    return true;
  }
  try {
    const auto places = load_places(config_.places_file);
    for (const auto& place : places) response.places.push_back(place.first);
    if (request.place.empty()) {
      response.message = "The known places.";
      return true;
    }
    const auto found = places.find(request.place);
    if (found == places.end()) {
      const std::string meant = nearest_word(request.place, response.places);
      response.message = "There is no place '" + request.place + "' in " + config_.places_file +
                         (meant.empty() ? "." : "; did you mean '" + meant + "'?");
      return true;
    }
    move_base_msgs::MoveBaseActionGoal goal;
    goal.header.stamp = ros::Time::now();
    goal.goal.target_pose.header.frame_id = config_.global_frame;
    goal.goal.target_pose.header.stamp = goal.header.stamp;
    goal.goal.target_pose.pose = pose_message(found->second);
    action_goal_pub_.publish(goal);
    response.accepted = true;
    response.message = "Going to " + request.place + ".";
  } catch (const UserError& error) {
    response.message = error.what();
  }
  return true;
}

}  // namespace knav
