// The action server and its topics against a small robot that lives in this test, on a clock of this test's own.
#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/Twist.h>
#include <gtest/gtest.h>
#include <kinect_nav/GoTo.h>
#include <kinect_nav/LocalizationStatus.h>
#include <kinect_nav/NavigationFailure.h>
#include <move_base_msgs/MoveBaseAction.h>
#include <nav_msgs/GetPlan.h>
#include <nav_msgs/OccupancyGrid.h>
#include <nav_msgs/Odometry.h>
#include <nav_msgs/Path.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <sensor_msgs/LaserScan.h>
#include <std_srvs/Empty.h>
#include <tf2_ros/transform_broadcaster.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <thread>

#include "ros_common/conversions.h"
#include "toy_world.h"

namespace knav {
namespace {

using Client = actionlib::SimpleActionClient<move_base_msgs::MoveBaseAction>;
using State = actionlib::SimpleClientGoalState;

constexpr double kWidth_m = 6.0, kHeight_m = 4.0;
const Pose2 kMapOdom{0.5, -0.2, 0.4};

/// Simulated time. Where a reaction is timed it runs at a tenth of the wall's pace, so that what the machine delays
/// counts a tenth: the test then measures the planner, not the load.
class Clock {
 public:
  Clock() : thread_([this] { run(); }) {}
  ~Clock() {
    stop_ = true;
    thread_.join();
  }
  std::atomic<double> pace{1.0};
  std::atomic<double> jump_s{0.0};  ///< to be added once

 private:
  void run() {
    ros::NodeHandle nh;
    ros::Publisher publisher = nh.advertise<rosgraph_msgs::Clock>("/clock", 10);
    rosgraph_msgs::Clock message;
    message.clock = ros::Time(100.0);
    while (!stop_ && ros::ok()) {
      message.clock += ros::Duration(kTick_s + jump_s.exchange(0.0));
      publisher.publish(message);
      ros::WallDuration(kTick_s / pace).sleep();
    }
  }
  static constexpr double kTick_s = 0.005;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};
std::unique_ptr<Clock> simulated_clock;

/// Drives as told, in an empty room, and publishes what the rest of the graph would.
class FakeRobot {
 public:
  FakeRobot() {
    ros::NodeHandle nh;
    map_pub_ = nh.advertise<nav_msgs::OccupancyGrid>("map", 1, true);
    odom_pub_ = nh.advertise<nav_msgs::Odometry>("odom", 10);
    scan_pub_ = nh.advertise<sensor_msgs::LaserScan>("scan_360", 5);
    status_pub_ = nh.advertise<kinect_nav::LocalizationStatus>("localization_status", 5);
    cmd_sub_ = nh.subscribe<geometry_msgs::Twist>("cmd_vel", 10,
                                                  [this](const geometry_msgs::Twist::ConstPtr& twist) {
                                                    const std::lock_guard<std::mutex> lock(mutex_);
                                                    v_ = twist->linear.x;
                                                    w_ = twist->angular.z;
                                                    ++commands;
                                                  });
    nav_msgs::OccupancyGrid map;
    occupancy_message(room(kWidth_m, kHeight_m), &map);
    map.header.frame_id = "map";
    map_pub_.publish(map);
    thread_ = std::thread([this] { live(); });
  }
  ~FakeRobot() {
    stop_ = true;
    thread_.join();
  }
  Pose2 pose() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return T_map_base_;
  }
  double commanded_v() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return v_;
  }
  bool commanded_still() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return v_ == 0.0 && w_ == 0.0;
  }
  std::atomic<bool> scan_alive{true};
  std::atomic<int> commands{0};

 private:
  void live() {
    ros::Rate rate(50.0);
    while (!stop_ && ros::ok()) {
      Pose2 pose;
      double v, w;
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        v = v_;
        w = w_;
        T_map_base_ = T_map_base_ * Pose2{v * 0.02, 0.0, w * 0.02};
        pose = T_map_base_;
      }
      publish(pose, v, w);
      rate.sleep();
    }
  }

  void publish(const Pose2& pose, double v, double w) {
    const ros::Time now = ros::Time::now();
    const Pose2 T_odom_base = kMapOdom.inverse() * pose;
    std::vector<geometry_msgs::TransformStamped> tf(2);
    tf[0].header.stamp = now + ros::Duration(0.1);
    tf[0].header.frame_id = "map";
    tf[0].child_frame_id = "odom";
    tf[0].transform = transform_message(kMapOdom);
    tf[1].header.stamp = now;
    tf[1].header.frame_id = "odom";
    tf[1].child_frame_id = "base_link";
    tf[1].transform = transform_message(T_odom_base);
    tf_.sendTransform(tf);
    nav_msgs::Odometry odom;
    odom.header.stamp = now;
    odom.header.frame_id = "odom";
    odom.child_frame_id = "base_link";
    odom.pose.pose = pose_message(T_odom_base);
    odom.twist.twist.linear.x = v;
    odom.twist.twist.angular.z = w;
    odom_pub_.publish(odom);
    kinect_nav::LocalizationStatus status;
    status.header.stamp = now;
    status.status = kinect_nav::LocalizationStatus::OK;
    status_pub_.publish(status);
    if (!scan_alive) return;
    sensor_msgs::LaserScan scan;
    scan.header.stamp = now;
    scan.header.frame_id = "base_link";
    scan.angle_min = static_cast<float>(-kPi);
    scan.angle_increment = static_cast<float>(2.0 * kPi / 360.0);
    scan.range_max = 20.0f;
    for (int i = 0; i < 360; ++i) {
      const double a = pose.yaw_rad - kPi + i * 2.0 * kPi / 360.0, c = std::cos(a), s = std::sin(a);
      const double rx = std::abs(c) < 1e-9 ? 1e9 : ((c > 0 ? kWidth_m - 0.05 : 0.05) - pose.x_m) / c;
      const double ry = std::abs(s) < 1e-9 ? 1e9 : ((s > 0 ? kHeight_m - 0.05 : 0.05) - pose.y_m) / s;
      scan.ranges.push_back(static_cast<float>(std::min(rx, ry)));
    }
    scan_pub_.publish(scan);
  }

  ros::Publisher map_pub_, odom_pub_, scan_pub_, status_pub_;
  ros::Subscriber cmd_sub_;
  tf2_ros::TransformBroadcaster tf_;
  std::mutex mutex_;
  Pose2 T_map_base_{1.0, 1.0, 0.0};
  double v_ = 0.0, w_ = 0.0;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

move_base_msgs::MoveBaseGoal goal_at(const Pose2& pose, const std::string& frame = "map") {
  move_base_msgs::MoveBaseGoal goal;
  goal.target_pose.header.frame_id = frame;
  goal.target_pose.header.stamp = ros::Time::now();
  goal.target_pose.pose = pose_message(pose);
  return goal;
}

class MoveBase : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(client.waitForServer(ros::Duration(20.0)));
    failure_sub = nh.subscribe<kinect_nav::NavigationFailure>(
        "navigation_failure", 10,
        [this](const kinect_nav::NavigationFailure::ConstPtr& m) { code = m->code; });
    ros::Duration(1.0).sleep();  // connections, the map
  }
  bool wait_for(const std::function<bool()>& what, double longest_s) {
    const ros::WallTime until = ros::WallTime::now() + ros::WallDuration(longest_s);
    while (!what()) {
      if (ros::WallTime::now() > until) return false;
      ros::WallDuration(0.005).sleep();
    }
    return true;
  }
  /// How long after `cause` cmd_vel is zero.
  double seconds_to_stand(const std::function<void()>& cause) {
    simulated_clock->pace = 0.1;
    const ros::Time start = ros::Time::now();
    cause();
    EXPECT_TRUE(wait_for([&] { return robot.commanded_still(); }, 20.0));
    const double seconds = (ros::Time::now() - start).toSec();
    simulated_clock->pace = 1.0;
    return seconds;
  }

  ros::NodeHandle nh;
  FakeRobot robot;
  Client client{"move_base", false};
  ros::Subscriber failure_sub;
  std::atomic<int> code{-1};
};

TEST_F(MoveBase, ReachesAGoalAndThenStands) {
  std::atomic<int> plans{0};
  const ros::Subscriber plan_sub = nh.subscribe<nav_msgs::Path>(
      "plan", 5, [&](const nav_msgs::Path::ConstPtr& m) { plans += !m->poses.empty(); });
  const Pose2 goal{4.0, 2.5, 1.0};
  client.sendGoal(goal_at(goal));
  ASSERT_TRUE(client.waitForResult(ros::Duration(25.0)));
  EXPECT_EQ(client.getState(), State::SUCCEEDED) << client.getState().getText();
  EXPECT_LT(distance_m(robot.pose(), goal), 0.08);
  EXPECT_LT(std::abs(normalize_angle_rad(robot.pose().yaw_rad - goal.yaw_rad)), 0.12);
  EXPECT_GT(plans, 10);
  EXPECT_TRUE(wait_for([&] { return robot.commanded_still(); }, 5.0));
  // Silent without a goal: someone else may drive.
  const int before = robot.commands;
  ros::Duration(0.5).sleep();
  EXPECT_LE(robot.commands - before, 1);
}

TEST_F(MoveBase, ANewGoalPreemptsTheOld) {
  Client other("move_base", false);
  ASSERT_TRUE(other.waitForServer(ros::Duration(10.0)));
  client.sendGoal(goal_at({4.5, 1.0, 0.0}));
  ASSERT_TRUE(wait_for([&] { return robot.commanded_v() > 0.2; }, 10.0));
  const Pose2 goal{2.0, 2.5, 0.0};
  other.sendGoal(goal_at(goal));
  ASSERT_TRUE(client.waitForResult(ros::Duration(2.0)));
  EXPECT_EQ(client.getState(), State::PREEMPTED);
  ASSERT_TRUE(other.waitForResult(ros::Duration(25.0)));
  EXPECT_EQ(other.getState(), State::SUCCEEDED) << other.getState().getText();
  EXPECT_LT(distance_m(robot.pose(), goal), 0.08);
}

TEST_F(MoveBase, CancellingStopsWithin300ms) {
  client.sendGoal(goal_at({5.0, 1.0, 0.0}));
  ASSERT_TRUE(wait_for([&] { return robot.commanded_v() > 0.3; }, 10.0));
  EXPECT_LT(seconds_to_stand([&] { client.cancelGoal(); }), 0.3);
  ASSERT_TRUE(client.waitForResult(ros::Duration(2.0)));
  EXPECT_EQ(client.getState(), State::PREEMPTED);
  ros::Duration(0.3).sleep();
  EXPECT_TRUE(robot.commanded_still());
}

TEST_F(MoveBase, GoalsThatMakeNoSenseAreRefusedInWords) {
  struct Case {
    move_base_msgs::MoveBaseGoal goal;
    const char* word;
  };
  std::vector<Case> cases{{goal_at({1.0, 1.0, 0.0}), "not a number"},
                          {goal_at({1.0, 1.0, 0.0}, "atlantis"), "atlantis"},
                          {goal_at({1.0, 1.0, 0.0}, ""), "no frame"},
                          {goal_at({1.0, 1.0, 0.0}), "quaternion"}};
  cases[0].goal.target_pose.pose.position.x = std::numeric_limits<double>::quiet_NaN();
  cases[3].goal.target_pose.pose.orientation = geometry_msgs::Quaternion();
  for (const Case& c : cases) {
    code = -1;
    client.sendGoal(c.goal);
    ASSERT_TRUE(client.waitForResult(ros::Duration(3.0))) << c.word;
    EXPECT_EQ(client.getState(), State::ABORTED);
    EXPECT_NE(client.getState().getText().find(c.word), std::string::npos) << client.getState().getText();
    EXPECT_TRUE(wait_for([&] { return code == kinect_nav::NavigationFailure::GOAL_INVALID; }, 1.0)) << c.word;
  }
  EXPECT_TRUE(robot.commanded_still());
}

TEST_F(MoveBase, AGoalInsideTheWallFailsWithItsCode) {
  client.sendGoal(goal_at({0.1, 2.0, 0.0}));
  ASSERT_TRUE(client.waitForResult(ros::Duration(3.0)));
  EXPECT_EQ(client.getState(), State::ABORTED);
  EXPECT_TRUE(wait_for([&] { return code == kinect_nav::NavigationFailure::GOAL_OCCUPIED; }, 1.0));
}

TEST_F(MoveBase, AStaleScanStopsWithin300msAndFailsTheGoalInTime) {
  client.sendGoal(goal_at({5.0, 1.0, 0.0}));
  ASSERT_TRUE(wait_for([&] { return robot.commanded_v() > 0.3; }, 10.0));
  EXPECT_LT(seconds_to_stand([&] { robot.scan_alive = false; }), 0.3);
  ASSERT_TRUE(client.waitForResult(ros::Duration(5.0)));
  EXPECT_EQ(client.getState(), State::ABORTED);
  EXPECT_NE(client.getState().getText().find("scan_360"), std::string::npos);
  EXPECT_TRUE(wait_for([&] { return code == kinect_nav::NavigationFailure::NO_SENSOR_DATA; }, 1.0));
}

TEST_F(MoveBase, PlansClearsAndGoesToPlaces) {
  nav_msgs::GetPlan plan;
  plan.request.goal = goal_at({4.0, 3.0, 0.0}).target_pose;
  ASSERT_TRUE(ros::service::call("move_base/make_plan", plan));
  ASSERT_GE(plan.response.plan.poses.size(), 2u);
  EXPECT_NEAR(plan.response.plan.poses.back().pose.position.x, 4.0, 1e-6);
  std_srvs::Empty empty;
  EXPECT_TRUE(ros::service::call("move_base/clear_costmaps", empty));
  kinect_nav::GoTo list;
  ASSERT_TRUE(ros::service::call("go_to", list));
  EXPECT_EQ(list.response.places, (std::vector<std::string>{"desk", "window"}));
  kinect_nav::GoTo wrong;
  wrong.request.place = "windw";
  ASSERT_TRUE(ros::service::call("go_to", wrong));
  EXPECT_FALSE(wrong.response.accepted);
  EXPECT_NE(wrong.response.message.find("window"), std::string::npos);
  kinect_nav::GoTo go;
  go.request.place = "desk";
  ASSERT_TRUE(ros::service::call("go_to", go));
  EXPECT_TRUE(go.response.accepted);
  EXPECT_TRUE(wait_for([&] { return distance_m(robot.pose(), {2.0, 1.0, 0.0}) < 0.08; }, 15.0));
}

// A looped bag or a restarted simulator; and a transform of the old time still on its way, which tf2's own listener
// takes in after it has emptied itself.
TEST_F(MoveBase, AClockThatJumpsBackEndsTheGoalAndTheNextOneIsReached) {
  client.sendGoal(goal_at({5.0, 1.0, 0.0}));
  ASSERT_TRUE(wait_for([&] { return robot.commanded_v() > 0.3; }, 10.0));
  const ros::Time before = ros::Time::now();
  geometry_msgs::TransformStamped late;
  late.header.stamp = before + ros::Duration(0.1);
  late.header.frame_id = "odom";
  late.child_frame_id = "base_link";
  late.transform = transform_message(kMapOdom.inverse() * robot.pose());
  simulated_clock->jump_s = -20.0;
  ASSERT_TRUE(wait_for([&] { return ros::Time::now() < before - ros::Duration(10.0); }, 5.0));
  ros::WallDuration(0.1).sleep();
  tf2_ros::TransformBroadcaster().sendTransform(late);
  ASSERT_TRUE(wait_for([&] { return client.getState().isDone(); }, 5.0));
  EXPECT_EQ(client.getState(), State::ABORTED);
  EXPECT_NE(client.getState().getText().find("clock"), std::string::npos) << client.getState().getText();
  EXPECT_TRUE(wait_for([&] { return robot.commanded_still(); }, 2.0));
  ros::WallDuration(1.0).sleep();
  const Pose2 goal{2.0, 2.5, 0.0};
  client.sendGoal(goal_at(goal));
  ASSERT_TRUE(wait_for([&] { return client.getState().isDone(); }, 25.0));
  EXPECT_EQ(client.getState(), State::SUCCEEDED) << client.getState().getText();
  EXPECT_LT(distance_m(robot.pose(), goal), 0.08);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_move_base");
  ros::NodeHandle keep_alive;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  knav::simulated_clock = std::make_unique<knav::Clock>();
  const int result = RUN_ALL_TESTS();
  knav::simulated_clock.reset();
  return result;
}
