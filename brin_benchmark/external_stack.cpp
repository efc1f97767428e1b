#include "brin_benchmark/external_stack.h"

#include <fmt/format.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <ros/service.h>
#include <std_srvs/Empty.h>
#include <tf2_msgs/TFMessage.h>

#include <thread>

#include "kinect_sim/stamp_waiter.h"
#include "ros_common/conversions.h"

namespace knav {
namespace {

const char* const kAction = "move_base";
const char* const kMapFrame = "map";
const char* const kOdometryFrame = "odom";
const char* const kBaseFrame = "base_link";
/// Wall time in which the result of a goal must come that the server's status no longer lists.
constexpr double kResultWithin_s = 2.0;
constexpr double kPlacedWithin_m = 0.1, kPlacedWithin_rad = 0.05;  ///< a person who sets a robot down knows the place so well

bool is_frame(const std::string& name, const char* frame) {
  return name == frame || (!name.empty() && name[0] == '/' && name.compare(1, std::string::npos, frame) == 0);
}

}  // namespace

ExternalStack::ExternalStack(ClockPacer* pacer, const std::string& wait_topic)
    : pacer_(pacer), listener_(tf_), watch_(handle_, kAction), client_(handle_, kAction, true) {
  initial_pose_ = handle_.advertise<geometry_msgs::PoseWithCovarianceStamped>("initialpose", 2);
  results_ = handle_.subscribe(std::string(kAction) + "/result", 5, &ExternalStack::on_result, this);
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  if (wait_topic.empty()) {
    answers_ = handle_.subscribe("/tf", 100, &ExternalStack::on_transforms, this, hints);
  } else {
    answers_ = handle_.subscribe(wait_topic, 10, &ExternalStack::on_answer, this, hints);
  }
}

ExternalStack::~ExternalStack() {
  if (!has_goal() || !has_server()) return;
  client_.cancelGoal();
  std::this_thread::sleep_for(std::chrono::milliseconds(100));  // publishers write in a thread of their own
}

void ExternalStack::on_transforms(const tf2_msgs::TFMessage::ConstPtr& message) {
  for (const auto& transform : message->transforms) {
    if (is_frame(transform.header.frame_id, kMapFrame) && is_frame(transform.child_frame_id, kOdometryFrame))
      pacer_->heard(ClockPacer::kPose, transform.header.stamp.toSec());
  }
}

void ExternalStack::on_answer(const topic_tools::ShapeShifter::ConstPtr& message) {
  double stamp_s = 0.0;
  if (header_stamp(*message, &stamp_s)) pacer_->heard(ClockPacer::kPose, stamp_s);
}

bool ExternalStack::estimate(Pose2* T_map_base, double* stamp_s) const {
  try {
    const auto found = tf_.lookupTransform(kMapFrame, kBaseFrame, ros::Time(0));
    *T_map_base = pose2_from(found.transform);
    if (stamp_s != nullptr) *stamp_s = found.header.stamp.toSec();
    return true;
  } catch (const tf2::TransformException&) {
    return false;
  }
}

void ExternalStack::say_pose(const Pose2& T_map_base, double stamp_s) {
  geometry_msgs::PoseWithCovarianceStamped message;
  message.header.frame_id = kMapFrame;
  message.header.stamp.fromSec(stamp_s);
  message.pose.pose = pose_message(T_map_base);
  message.pose.covariance[0] = message.pose.covariance[7] = kPlacedWithin_m * kPlacedWithin_m;
  message.pose.covariance[35] = kPlacedWithin_rad * kPlacedWithin_rad;
  initial_pose_.publish(message);
}

void ExternalStack::clear_costmaps() {
  // A server that hangs must not hang the benchmark: the call has a thread that nobody waits for.
  const std::string service = handle_.resolveName("move_base/clear_costmaps");
  std::thread([service] {
    std_srvs::Empty empty;
    if (ros::service::exists(service, false)) ros::service::call(service, empty);
  }).detach();
}

void ExternalStack::send_goal(const Pose2& T_map_goal) {
  int goal = 0;
  departures_ = watch_.departures();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    goal = ++goals_;
    has_goal_ = true;
    unlisted_ = false;
    sent_ = ros::Time::now();
    state_ = GoalState::kDriving;
    failure_.clear();
  }
  move_base_msgs::MoveBaseGoal message;
  message.target_pose.header.frame_id = kMapFrame;
  message.target_pose.header.stamp = ros::Time::now();
  message.target_pose.pose = pose_message(T_map_goal);
  client_.sendGoal(message, [this, goal](const actionlib::SimpleClientGoalState& state,
                                         const move_base_msgs::MoveBaseResultConstPtr&) { on_done(goal, state); });
}

void ExternalStack::on_done(int goal, const actionlib::SimpleClientGoalState& state) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (goal != goals_ || !has_goal_) return;
  if (state != actionlib::SimpleClientGoalState::LOST) {
    end_goal(state == actionlib::SimpleClientGoalState::SUCCEEDED, state.getText(), state.toString());
    return;
  }
  // A server lists what has ended for five seconds only, by a clock that may be fast: the client then takes the goal for lost
  // and no longer hears its result, which may still be on its way.
  unlisted_ = true;
  unlisted_since_ = std::chrono::steady_clock::now();
  if (last_result_.goal_id.stamp >= sent_) end_unlisted_goal();
}

void ExternalStack::on_result(const move_base_msgs::MoveBaseActionResult::ConstPtr& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  last_result_ = message->status;
  if (has_goal_ && unlisted_ && last_result_.goal_id.stamp >= sent_) end_unlisted_goal();
}

void ExternalStack::end_unlisted_goal() {
  end_goal(last_result_.status == actionlib_msgs::GoalStatus::SUCCEEDED, last_result_.text, fmt::format("status {}", last_result_.status));
}

void ExternalStack::end_goal(bool reached, const std::string& text, const std::string& state) {
  has_goal_ = false;
  state_ = reached ? GoalState::kReached : GoalState::kFailed;
  failure_ = text;
  if (!reached && failure_.empty()) failure_ = "move_base gave the goal up (" + state + ") without a word.";
}

void ExternalStack::cancel() {
  if (has_goal()) client_.cancelGoal();
}

bool ExternalStack::has_goal() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return has_goal_;
}

bool ExternalStack::lost_server() const { return !has_server() || watch_.departures() != departures_; }

GoalState ExternalStack::take_state() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (has_goal_ && unlisted_ && std::chrono::duration<double>(std::chrono::steady_clock::now() - unlisted_since_).count() > kResultWithin_s) {
    end_goal(false, "move_base no longer lists the goal, and no result of it came.", "");
  }
  const GoalState state = state_;
  state_ = GoalState::kDriving;
  return state;
}

std::string ExternalStack::failure() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return failure_;
}

}  // namespace knav
