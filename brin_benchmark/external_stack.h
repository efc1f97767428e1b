#pragma once

#include <actionlib/client/simple_action_client.h>
#include <move_base_msgs/MoveBaseAction.h>
#include <ros/node_handle.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>
#include <topic_tools/shape_shifter.h>

#include <chrono>
#include <memory>
#include <mutex>
#include <string>

#include "brin_benchmark/action_server_watch.h"
#include "brin_benchmark/benchmark_robot.h"
#include "brin_benchmark/clock_pacer.h"
#include "core/pose2.h"

namespace knav {

/// The robot's software as any stack with move_base shows it: the action, initialpose, TF, clear_costmaps.
class ExternalStack {
 public:
  static constexpr char kServerGone[] = "the move_base action server went away.";

  /// @param pacer       told of the stack's poses
  /// @param wait_topic  see ExternalOptions
  ExternalStack(ClockPacer* pacer, const std::string& wait_topic);
  /// Takes the goal back.
  ~ExternalStack();

  bool has_server() const { return client_.isServerConnected(); }
  bool takes_initial_poses() const { return initial_pose_.getNumSubscribers() > 0; }
  std::string action() const { return handle_.resolveName("move_base"); }
  std::string initial_pose_topic() const { return initial_pose_.getTopic(); }

  /// Where the stack believes the robot is, by TF map -> base_link; false if it does not say.
  /// @param stamp_s  of that transform; may be null
  bool estimate(Pose2* T_map_base, double* stamp_s = nullptr) const;
  void say_pose(const Pose2& T_map_base, double stamp_s);
  /// Calls move_base/clear_costmaps, if there is one, without waiting for it.
  void clear_costmaps();

  void send_goal(const Pose2& T_map_goal);
  void cancel();
  bool has_goal() const;
  /// The server that got the goal is no more, though another may have taken its place.
  bool lost_server() const;
  /// What became of the goal is told once; failure() then has the server's words.
  GoalState take_state();
  std::string failure() const;

 private:
  using Client = actionlib::SimpleActionClient<move_base_msgs::MoveBaseAction>;
  void on_done(int goal, const actionlib::SimpleClientGoalState& state);
  void on_result(const move_base_msgs::MoveBaseActionResult::ConstPtr& message);
  /// Both with the mutex held.
  void end_goal(bool reached, const std::string& text, const std::string& state);
  void end_unlisted_goal();
  void on_transforms(const tf2_msgs::TFMessage::ConstPtr& message);
  void on_answer(const topic_tools::ShapeShifter::ConstPtr& message);

  ros::NodeHandle handle_;
  ClockPacer* pacer_;
  tf2_ros::Buffer tf_;
  tf2_ros::TransformListener listener_;
  ros::Publisher initial_pose_;
  ros::Subscriber answers_;
  ActionServerWatch watch_;
  int departures_ = 0;  ///< of servers, when the goal was sent

  mutable std::mutex mutex_;  ///< what the action client's thread tells
  int goals_ = 0;             ///< sent so far; what is told of an older one is not heard
  bool has_goal_ = false;
  GoalState state_ = GoalState::kDriving;
  std::string failure_;
  ros::Time sent_;
  bool unlisted_ = false;  ///< the server's status lists the goal no longer, and its result has not come
  std::chrono::steady_clock::time_point unlisted_since_;
  actionlib_msgs::GoalStatus last_result_;
  ros::Subscriber results_;  ///< after what its thread touches, so that it ends before
  Client client_;  ///< last, so that its thread ends first
};

}  // namespace knav
