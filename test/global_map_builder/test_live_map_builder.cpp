#include <gtest/gtest.h>
#include <kinect_nav/DepthProfile.h>
#include <nav_msgs/OccupancyGrid.h>
#include <nav_msgs/Odometry.h>
#include <nodelet/loader.h>
#include <ros/ros.h>
#include <ros/topic.h>
#include <std_msgs/Empty.h>
#include <std_msgs/UInt32.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>

#include "flat_drive.h"
#include "global_map_builder/map_directory.h"
#include "ros_common/conversions.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

using namespace flat_world;

/// The camera looks forward, 0.5 m above the floor.
geometry_msgs::TransformStamped mount() {
  geometry_msgs::TransformStamped t;
  t.header.stamp = ros::Time::now();
  t.header.frame_id = "base_link";
  t.child_frame_id = "camera";
  t.transform.translation.x = kMount.x_m;
  t.transform.translation.z = 0.5;
  t.transform.rotation.x = -0.5;
  t.transform.rotation.y = 0.5;
  t.transform.rotation.z = -0.5;
  t.transform.rotation.w = 0.5;
  return t;
}

TEST(LiveMapBuilder, ShowsTheGrowingMapCountsMarksAndWritesTheDirectory) {
  const fs::path folder = fs::temp_directory_path() / ("knav_live_map_" + std::to_string(getpid()));
  ros::NodeHandle node;
  ros::param::set("/live_map_builder/directory", folder.string());
  ros::param::set("/live_map_builder/map_period_s", 0.5);
  ros::param::set("/live_map_builder/build_at_end", false);
  ros::param::set("/local_mapper/filter/particles", 200);
  nodelet::Loader loader;
  ASSERT_TRUE(loader.load("/live_map_builder", "kinect_nav/LiveMapBuilder", {}, {}));
  tf2_ros::StaticTransformBroadcaster broadcaster;
  broadcaster.sendTransform(mount());
  auto odometry = node.advertise<nav_msgs::Odometry>("odom", 500);
  auto profiles = node.advertise<kinect_nav::DepthProfile>("depth_profile", 500);
  auto marks = node.advertise<std_msgs::Empty>("mark_place", 10);
  ros::AsyncSpinner spinner(2);
  spinner.start();
  nav_msgs::OccupancyGrid::ConstPtr shown;
  const auto growing = node.subscribe<nav_msgs::OccupancyGrid>(
      "growing_map", 1, [&](const nav_msgs::OccupancyGrid::ConstPtr& m) { shown = m; });
  const ros::WallTime patience = ros::WallTime::now() + ros::WallDuration(10.0);
  while ((profiles.getNumSubscribers() == 0 || odometry.getNumSubscribers() == 0 ||
          marks.getNumSubscribers() == 0) &&
         ros::WallTime::now() < patience) {
    ros::WallDuration(0.05).sleep();
  }
  ros::WallDuration(0.5).sleep();  // the static transform

  std_srvs::Trigger nothing_yet;
  ASSERT_TRUE(ros::service::call("finish_mapping", nothing_yet));
  EXPECT_FALSE(nothing_yet.response.success);
  EXPECT_NE(nothing_yet.response.message.find("nothing was seen"), std::string::npos);

  Route route;
  route.truth = drive_through({{0, 0}, {5, 0}});
  route.odometry = drifting_odometry(route.truth);
  const double start_s = ros::Time::now().toSec();
  for (std::size_t i = 0; i < route.truth.size(); ++i) {
    const double stamp_s = start_s + 0.1 * static_cast<double>(i);
    RandomStream random(7, random_stream::kTest, i, 0);
    kinect_nav::DepthProfile profile;
    profile.header.stamp.fromSec(stamp_s);
    profile.header.frame_id = "camera";
    profile_message(profile_at(route.walls, route.truth[i] * kMount, stamp_s, random), &profile);
    profile.header.frame_id = "camera";
    nav_msgs::Odometry odom;
    odom.header.stamp.fromSec(stamp_s);
    odom.pose.pose = pose_message(route.odometry[i]);
    profiles.publish(profile);
    odometry.publish(odom);
    if (i == 20) marks.publish(std_msgs::Empty());
    ros::WallDuration(0.02).sleep();
  }
  const auto counted = ros::topic::waitForMessage<std_msgs::UInt32>("marks_counted", ros::Duration(5.0));
  ASSERT_TRUE(counted);
  EXPECT_EQ(counted->data, 1u);
  ros::WallDuration(1.5).sleep();
  ASSERT_TRUE(shown) << "no growing_map came";
  EXPECT_EQ(shown->header.frame_id, "odom");
  EXPECT_GT(std::count(shown->data.begin(), shown->data.end(), 100), 30);
  EXPECT_GT(std::count(shown->data.begin(), shown->data.end(), 0), 1000);

  std_srvs::Trigger finish;
  ASSERT_TRUE(ros::service::call("finish_mapping", finish));
  EXPECT_TRUE(finish.response.success) << finish.response.message;
  const MapDirectory map = load_map(folder.string());
  EXPECT_TRUE(map.warnings.empty());
  EXPECT_GT(map.trajectory.size(), route.truth.size() * 9 / 10);
  EXPECT_NEAR(map.distance.nearest(4.5, 0.0), std::hypot(0.3, 1.0), 0.1)
      << "the cupboard's corner at (4.2, -1)";
  EXPECT_TRUE(fs::exists(folder / "report.html"));
  EXPECT_TRUE(fs::exists(folder / "drives.bin"));
  fs::remove_all(folder);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_live_map_builder");
  return RUN_ALL_TESTS();
}
