// rostest: the simulator's clock, rates, frames and services, as other nodes see them.
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/LaserScan.h>
#include <std_msgs/Bool.h>
#include <std_srvs/Empty.h>

#include <chrono>
#include <cmath>
#include <thread>
#include <vector>

namespace {

using Wall = std::chrono::steady_clock;

/// Spins on wall time until the condition holds.
template <class Condition>
bool wait_until(const Condition& condition, double limit_s) {
  const auto start = Wall::now();
  while (ros::ok() && std::chrono::duration<double>(Wall::now() - start).count() < limit_s) {
    ros::spinOnce();
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return false;
}

/// Stamps of everything a topic says.
struct Stamps {
  std::vector<double> s;
  double rate_hz() const {
    return s.size() > 1 ? static_cast<double>(s.size() - 1) / (s.back() - s.front()) : 0.0;
  }
  bool rising() const {
    for (std::size_t i = 1; i < s.size(); ++i) {
      if (s[i] <= s[i - 1]) return false;
    }
    return true;
  }
};

TEST(SimulatorNode, ClockOdometryAndFramesComeAtTheirRatesAndTheTourEnds) {
  ros::NodeHandle handle;
  Stamps clock, odom, images, infos, scans;
  bool done = false;
  sensor_msgs::Image::ConstPtr image;
  nav_msgs::Odometry truth;
  const auto clock_sub = handle.subscribe<rosgraph_msgs::Clock>(
      "/clock", 1000, [&](const rosgraph_msgs::Clock::ConstPtr& m) { clock.s.push_back(m->clock.toSec()); });
  const auto odom_sub = handle.subscribe<nav_msgs::Odometry>(
      "odom", 1000, [&](const nav_msgs::Odometry::ConstPtr& m) { odom.s.push_back(m->header.stamp.toSec()); });
  const auto truth_sub = handle.subscribe<nav_msgs::Odometry>(
      "ground_truth", 1000, [&](const nav_msgs::Odometry::ConstPtr& m) { truth = *m; });
  const auto image_sub =
      handle.subscribe<sensor_msgs::Image>("camera/depth/image_raw", 100, [&](const sensor_msgs::Image::ConstPtr& m) {
        image = m;
        images.s.push_back(m->header.stamp.toSec());
      });
  const auto info_sub = handle.subscribe<sensor_msgs::CameraInfo>(
      "camera/depth/camera_info", 100,
      [&](const sensor_msgs::CameraInfo::ConstPtr& m) { infos.s.push_back(m->header.stamp.toSec()); });
  const auto scan_sub = handle.subscribe<sensor_msgs::LaserScan>(
      "lidar_scan", 100, [&](const sensor_msgs::LaserScan::ConstPtr& m) { scans.s.push_back(m->header.stamp.toSec()); });
  const auto done_sub = handle.subscribe<std_msgs::Bool>("tour_done", 2,
                                                         [&](const std_msgs::Bool::ConstPtr& m) { done = m->data; });
  ASSERT_TRUE(wait_until([&] { return images.s.size() > 60 && done && scans.s.size() > 10; }, 60.0));

  EXPECT_GE(clock.rate_hz(), 100.0);
  EXPECT_TRUE(clock.rising());
  EXPECT_NEAR(odom.rate_hz(), 50.0, 1.0);
  EXPECT_TRUE(odom.rising());
  EXPECT_TRUE(images.rising());
  EXPECT_LE(images.rate_hz(), 30.1);
  EXPECT_GE(images.rate_hz(), 10.0);  // a loaded test machine drops frames; it does not bend time
  for (std::size_t i = 1; i < images.s.size(); ++i) {
    const double periods = (images.s[i] - images.s[i - 1]) * 30.0;
    EXPECT_NEAR(periods, std::round(periods), 1e-3);
  }
  ASSERT_TRUE(image);
  EXPECT_EQ(image->encoding, "16UC1");
  EXPECT_EQ(image->header.frame_id, "camera_depth_optical_frame");
  EXPECT_EQ(image->data.size(), 640u * 480u * 2u);
  EXPECT_NEAR(static_cast<double>(infos.s.size()), static_cast<double>(images.s.size()), 3.0);
  EXPECT_NEAR(truth.pose.pose.position.x, 0.5, 0.15);

  // Kidnapped, then put back.
  ros::Publisher set_pose = handle.advertise<geometry_msgs::PoseStamped>("set_pose", 1, true);
  geometry_msgs::PoseStamped pose;
  pose.header.frame_id = "world";
  pose.pose.position.x = 3.0;
  pose.pose.orientation.w = 1.0;
  set_pose.publish(pose);
  EXPECT_TRUE(wait_until([&] { return std::abs(truth.pose.pose.position.x - 3.0) < 0.01; }, 20.0));
  std_srvs::Empty empty;
  ASSERT_TRUE(ros::service::call("simulator/reset", empty));
  EXPECT_TRUE(wait_until([&] { return std::abs(truth.pose.pose.position.x) < 0.01; }, 20.0));
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_simulator_node");
  return RUN_ALL_TESTS();
}
