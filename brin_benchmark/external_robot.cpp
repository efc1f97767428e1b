#include "brin_benchmark/external_robot.h"

#include <fmt/format.h>
#include <ros/ros.h>

#include <chrono>

#include "brin_benchmark/set_down.h"
#include "core/error.h"
#include "ros_common/program.h"

namespace knav {
namespace {

constexpr double kLook_s = 1.0;         ///< after the robot was set down, as in lock-step
constexpr double kPoseWithin_s = 10.0;  ///< wall time in which a stack shows its pose in TF, if it ever does
constexpr double kFreshPose_s = 0.5;

}  // namespace

ExternalRobot::ExternalRobot(ExternalSimulation* simulation, ExternalStack* stack, double ready_within_s,
                             const SimulatorConfig& config, const WorldConfig& world)
    : simulation_(simulation), stack_(stack), ready_within_s_(ready_within_s), config_(config), world_(world) {
  // Nodes may start only once the clock runs, so it does while they are waited for.
  simulation_->load(config_, world_);
  await_stack();
}

void ExternalRobot::record(Trajectory* truth, Trajectory* estimate) {
  truth_ = truth;
  estimate_ = estimate;
}

void ExternalRobot::advance() {
  stop_if_interrupted();
  if (!ros::ok()) throw UserError("the node was shut down, by rosnode kill or because another one took its name; the run is not scored.");
  simulation_->step(stack_->has_goal());
  if (truth_ == nullptr || !track_.due(now_s())) return;
  truth_->push_back({now_s(), simulator().T_world_base()});
  Pose2 T_map_robot;
  if (stack_->estimate(&T_map_robot)) estimate_->push_back({now_s(), T_map_robot});
}

template <class Condition>
bool ExternalRobot::advance_until(const Condition& condition, double within_s) {
  const auto start = std::chrono::steady_clock::now();
  while (!condition()) {
    if (std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() > within_s) return false;
    advance();
  }
  return true;
}

void ExternalRobot::await_stack() {
  if (!advance_until([&] { return stack_->has_server(); }, ready_within_s_)) {
    throw UserError(fmt::format(
        "nobody offers the action {} within {:.0f} s: start the robot's navigation, or give it longer with --ready-within.",
        stack_->action(), ready_within_s_));
  }
  if (!advance_until([&] { return simulation_->commands_come(); }, ready_within_s_)) {
    throw UserError(fmt::format(
        "nobody publishes on {}, where the robot's velocity commands must come: remap your stack's topic to it.",
        simulation_->command_topic()));
  }
}

void ExternalRobot::say_pose(const Pose2& T_map_robot) {
  if (!advance_until([&] { return stack_->takes_initial_poses(); }, kPoseWithin_s)) {
    ROS_WARN_ONCE("Nobody listens to %s: the stack must find out by itself where the robot is set down.",
                  stack_->initial_pose_topic().c_str());
  }
  stack_->clear_costmaps();
  stack_->say_pose(T_map_robot, now_s());
  for (const double until_s = now_s() + kLook_s; now_s() < until_s;) advance();
}

void ExternalRobot::start(const Pose2& T_map_robot) {
  // Localizers take their time at first; the run's building shall not be old before the run begins.
  say_pose(T_map_robot);
  const auto located = [&] {
    Pose2 T;
    double stamp_s = 0.0;
    return stack_->estimate(&T, &stamp_s) && stamp_s > now_s() - kFreshPose_s;
  };
  if (!advance_until(located, kPoseWithin_s)) {
    ROS_WARN("No transform map -> base_link within %.0f s: the stack's pose is not recorded.", kPoseWithin_s);
  }
  simulation_->load(config_, world_);
  truth_->clear();
  estimate_->clear();
  say_pose(T_map_robot);
}

bool ExternalRobot::place_near(const Pose2& T_world_robot, const Pose2& T_map_robot) {
  // What was cancelled ends, or it would drive on where the robot is set down.
  stack_->cancel();
  for (const double until_s = now_s() + kLook_s; stack_->has_goal() && now_s() < until_s;) advance();
  Pose2 aside;
  const bool placed = set_down_near([&](const Pose2& tried) {
    aside = tried;
    return simulation_->set_pose(T_world_robot * tried);
  });
  if (!placed) return false;
  if (!advance_until([&] { return stack_->has_server(); }, ready_within_s_)) {
    throw UserError(fmt::format(
        "the action server {} went away and did not come back within {:.0f} s: start the robot's navigation again, then "
        "the benchmark, which repeats this run.",
        stack_->action(), ready_within_s_));
  }
  say_pose(T_map_robot * aside);
  return true;
}

bool ExternalRobot::set_goal(const Pose2& T_map_goal) {
  failure_ = ExternalStack::kServerGone;
  if (!stack_->has_server()) return false;
  stack_->send_goal(T_map_goal);
  return true;
}

GoalState ExternalRobot::step() {
  advance();
  const GoalState state = stack_->take_state();
  if (state == GoalState::kFailed) failure_ = stack_->failure();
  if (state != GoalState::kDriving || !stack_->lost_server()) return state;
  failure_ = ExternalStack::kServerGone;
  return GoalState::kFailed;
}

}  // namespace knav
