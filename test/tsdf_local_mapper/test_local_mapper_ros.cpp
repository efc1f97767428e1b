// The local mapper in the graph: every output, frames waiting for odometry, a LaserScan instead of profiles, the
// localizer's doubt, a clock that jumps back, and no stamp sent twice.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <gtest/gtest.h>
#include <kinect_nav/DepthProfile.h>
#include <kinect_nav/LocalizationStatus.h>
#include <kinect_nav/MotionEstimate.h>
#include <nav_msgs/OccupancyGrid.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_msgs/TFMessage.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "ros_common/conversions.h"
#include "test/tsdf_local_mapper/room_world.h"

namespace knav {
namespace {

class LocalMapperGraph : public ::testing::Test {
 protected:
  void SetUp() override {
    odom_ = node_.advertise<nav_msgs::Odometry>("odom", 100);
    profile_ = node_.advertise<kinect_nav::DepthProfile>("depth_profile", 10);
    initial_pose_ = node_.advertise<geometry_msgs::PoseWithCovarianceStamped>("initialpose", 1);
    laser_ = node_.advertise<sensor_msgs::LaserScan>("scan_in", 10);
    localization_ = node_.advertise<kinect_nav::LocalizationStatus>("localization_status", 1, true);
    const auto keep = [this](auto& list, const auto& message) { list.push_back(*message); };
    subscribers_ = {
        node_.subscribe<kinect_nav::MotionEstimate>("motion_estimate", 100,
                                                    [=](const auto& m) { keep(motion, m); }),
        node_.subscribe<sensor_msgs::LaserScan>("scan_360", 100, [=](const auto& m) { keep(scans, m); }),
        node_.subscribe<nav_msgs::OccupancyGrid>("local_map", 10, [=](const auto& m) { keep(maps, m); }),
        node_.subscribe<geometry_msgs::PoseArray>("local_particlecloud", 10,
                                                  [=](const auto& m) { keep(clouds, m); }),
        node_.subscribe<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10,
                                                          [=](const auto& m) { keep(reports, m); }),
        node_.subscribe<tf2_msgs::TFMessage>("/tf", 100, [this](const tf2_msgs::TFMessageConstPtr& m) {
          for (const auto& T : m->transforms) {
            if (T.child_frame_id == "local_map") transforms.push_back(T);
          }
        })};
    geometry_msgs::TransformStamped T;  // optical frame: z forward, x right
    T.header.frame_id = "base_link";
    T.child_frame_id = "camera_depth_optical_frame";
    T.transform.translation.x = 0.05;
    T.transform.translation.z = 0.5;
    T.transform.rotation.x = -0.5;
    T.transform.rotation.y = 0.5;
    T.transform.rotation.z = -0.5;
    T.transform.rotation.w = 0.5;
    geometry_msgs::TransformStamped L;
    L.header.frame_id = "base_link";
    L.child_frame_id = "laser";
    L.transform.rotation.w = 1.0;
    broadcaster_.sendTransform(std::vector<geometry_msgs::TransformStamped>{T, L});
    ASSERT_TRUE(wait([&] { return odom_.getNumSubscribers() > 0 && profile_.getNumSubscribers() > 0; }));
  }

  bool wait(const std::function<bool()>& done, double timeout_s = 10.0) {
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(timeout_s);
    while (!done() && ros::WallTime::now() < end && ros::ok()) {
      ros::spinOnce();
      ros::WallDuration(0.005).sleep();
    }
    return done();
  }
  void send_odometry() {
    nav_msgs::Odometry message;
    message.header.stamp = ros::Time(stamp_s_);
    message.header.frame_id = "odom";
    message.child_frame_id = "base_link";
    message.pose.pose = pose_message(robot_.T_odom_base);
    odom_.publish(message);
  }
  void send_profile() {
    kinect_nav::DepthProfile message;
    profile_message(world_.profile(robot_.T_world_base * Pose2{0.05, 0.0, 0.0}, stamp_s_), &message);
    message.header.frame_id = "camera_depth_optical_frame";
    profile_.publish(message);
  }
  /// How many the map holds, from the next report; -1 if none comes.
  int observations() {
    reports.clear();
    int count = -1;
    wait([&] {
      for (const auto& report : reports) {
        for (const auto& status : report.status) {
          for (const auto& value : status.values) {
            if (value.key == "observations in the map") count = std::stoi(value.value);
          }
        }
      }
      return count >= 0;
    });
    return count;
  }
  /// Drives frame by frame, each answered before the next is sent.
  void drive(int frames, double distance_m, double turn_rad) {
    for (int i = 0; i < frames; ++i) {
      stamp_s_ += 1.0 / 30.0;
      robot_.drive(distance_m, turn_rad);
      const std::size_t before = motion.size();
      send_odometry();
      send_profile();
      ASSERT_TRUE(wait([&] { return motion.size() > before; }, 5.0)) << "frame " << i;
    }
  }

  ros::NodeHandle node_;
  ros::Publisher odom_, profile_, laser_, initial_pose_, localization_;
  std::vector<ros::Subscriber> subscribers_;
  tf2_ros::StaticTransformBroadcaster broadcaster_;
  RoomWorld world_ = RoomWorld::furnished();
  DrivenRobot robot_;
  double stamp_s_ = 1000.0;

 public:
  std::vector<kinect_nav::MotionEstimate> motion;
  std::vector<sensor_msgs::LaserScan> scans;
  std::vector<nav_msgs::OccupancyGrid> maps;
  std::vector<geometry_msgs::PoseArray> clouds;
  std::vector<diagnostic_msgs::DiagnosticArray> reports;
  std::vector<geometry_msgs::TransformStamped> transforms;
};

// One test: the node under test lives through it all.
TEST_F(LocalMapperGraph, EverythingItPublishes) {
  // Frames may be lost until TF has arrived, so the first is sent until it is answered.
  ASSERT_TRUE(wait([&] {
    stamp_s_ += 1.0 / 30.0;
    send_odometry();
    send_profile();
    ros::WallDuration(0.05).sleep();
    ros::spinOnce();
    return !motion.empty();
  }));
  drive(60, 0.02, 0.01);
  ASSERT_TRUE(
      wait([&] { return !scans.empty() && !maps.empty() && !clouds.empty() && !transforms.empty(); }));

  EXPECT_EQ(motion.back().header.frame_id, "local_map");
  EXPECT_EQ(motion.back().child_frame_id, "base_link");
  EXPECT_NEAR(motion.back().header.stamp.toSec(), stamp_s_, 1e-6);
  EXPECT_NEAR(motion.back().twist.twist.linear.x, 0.6, 0.3);
  EXPECT_GT(motion.back().pose.covariance[35], 0.0);
  const Pose2 error = robot_.T_world_base.inverse() * pose2_from(motion.back().pose.pose);
  EXPECT_LT(std::hypot(error.x_m, error.y_m), 0.05);

  ASSERT_TRUE(wait([&] { return std::fabs(scans.back().header.stamp.toSec() - stamp_s_) < 1e-6; }));
  const sensor_msgs::LaserScan& scan = scans.back();
  EXPECT_EQ(scan.header.frame_id, "base_link");
  ASSERT_EQ(scan.ranges.size(), 3600u);
  ASSERT_EQ(scan.intensities.size(), 3600u);
  EXPECT_NEAR(scan.ranges[1800],
              world_.range(robot_.T_world_base.x_m, robot_.T_world_base.y_m, robot_.T_world_base.yaw_rad),
              0.15);
  EXPECT_EQ(scan.intensities[1800], 1.0f);
  EXPECT_EQ(maps.back().header.frame_id, "local_map");
  EXPECT_EQ(maps.back().data.size(), maps.back().info.width * maps.back().info.height);
  EXPECT_GT(std::count(maps.back().data.begin(), maps.back().data.end(), 100), 50);
  EXPECT_EQ(clouds.back().poses.size(), 300u);

  // The leaf closes the chain: odom -> local_map -> base_link is odometry.
  ASSERT_TRUE(wait([&] { return std::fabs(transforms.back().header.stamp.toSec() - stamp_s_) < 1e-6; }));
  EXPECT_EQ(transforms.back().header.frame_id, "odom");
  const Pose2 T_odom_base = pose2_from(transforms.back().transform) * pose2_from(motion.back().pose.pose);
  EXPECT_LT(distance_m(T_odom_base, robot_.T_odom_base), 1e-6);

  // A frame ahead of odometry waits, and is answered once odometry has come.
  const std::size_t before = motion.size();
  stamp_s_ += 0.5;
  send_profile();
  wait([] { return false; }, 0.3);
  EXPECT_EQ(motion.size(), before);
  send_odometry();
  EXPECT_TRUE(wait([&] { return motion.size() == before + 1; }));
  send_profile();  // the same stamp again: nothing
  wait([] { return false; }, 0.3);
  EXPECT_EQ(motion.size(), before + 1);

  // A plain LaserScan does as well.
  stamp_s_ += 0.1;
  send_odometry();
  sensor_msgs::LaserScan laser;
  scan_message(world_.scan(robot_.T_world_base, stamp_s_, kPi, 361), &laser);
  laser.header.frame_id = "laser";
  laser_.publish(laser);
  EXPECT_TRUE(wait([&] { return motion.size() == before + 2; }));
  EXPECT_EQ(motion.back().epoch, motion.front().epoch);

  std::set<double> stamps;
  for (const auto& T : transforms)
    EXPECT_TRUE(stamps.insert(T.header.stamp.toSec()).second) << "a stamp sent twice";

  // While the localizer is in doubt only the last metre is remembered (window/doubtful_distance_m here).
  EXPECT_GT(observations(), 50);
  kinect_nav::LocalizationStatus doubt;
  doubt.status = kinect_nav::LocalizationStatus::UNCERTAIN;
  localization_.publish(doubt);
  drive(100, 0.04, 0.04);  // round in a metre
  EXPECT_LT(observations(), 40);

  // The clock jumps back: a new epoch, and life goes on.
  const std::uint32_t epoch = motion.back().epoch;
  stamp_s_ -= 50.0;
  drive(5, 0.02, 0.0);
  EXPECT_EQ(motion.back().epoch, epoch + 1);

  // Somebody says where the robot is: the local map begins anew. The message has a way of its own, so the frames go on.
  initial_pose_.publish(geometry_msgs::PoseWithCovarianceStamped());
  EXPECT_TRUE(wait([&] {
    stamp_s_ += 1.0 / 30.0;
    send_odometry();
    send_profile();
    return motion.back().epoch == epoch + 2;
  }));

  EXPECT_TRUE(wait([&] {
    return std::any_of(reports.begin(), reports.end(), [](const auto& report) {
      return std::any_of(report.status.begin(), report.status.end(), [](const auto& status) {
        return status.name.find("local mapper") != std::string::npos && status.values.size() > 10;
      });
    });
  }));
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_local_mapper_ros");
  ros::NodeHandle keeps_ros_up;
  return RUN_ALL_TESTS();
}
