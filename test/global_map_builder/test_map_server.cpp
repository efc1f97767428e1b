#include <gtest/gtest.h>
#include <kinect_nav/DistanceMap.h>
#include <kinect_nav/GetDistanceMap.h>
#include <kinect_nav/LoadMap.h>
#include <nav_msgs/GetMap.h>
#include <nodelet/loader.h>
#include <ros/ros.h>
#include <ros/topic.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "core/occupancy_distance.h"
#include "global_map_builder/map_directory.h"
#include "ros_common/conversions.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

MapDirectory map_of(int width, std::int8_t first) {
  MapDirectory map;
  map.occupancy.geometry = {width, 2, 0.05, -1.0, 2.0};
  map.occupancy.value.assign(map.occupancy.geometry.cell_count(), 0);
  map.occupancy.value[0] = first;
  map.occupancy.value[1] = -1;
  map.distance = distance_from_occupancy(map.occupancy);
  return map;
}

template <class Message>
boost::shared_ptr<const Message> newest(const std::string& topic) {
  return ros::topic::waitForMessage<Message>(topic, ros::Duration(10.0));
}

TEST(MapServer, ServesAMapDirectoryAndSwitches) {
  const fs::path folder = fs::temp_directory_path() / ("knav_map_server_" + std::to_string(getpid()));
  const std::string first = (folder / "first").string(), second = (folder / "second").string();
  fs::create_directories(folder);
  const std::string checksum = save_map(first, map_of(3, 100));
  save_map(second, map_of(5, 0));

  ros::param::set("/map_server/map_path", first);
  nodelet::Loader loader;
  ASSERT_TRUE(loader.load("/map_server", "kinect_nav/MapServer", {}, {}));
  ros::AsyncSpinner spinner(2);
  spinner.start();

  const auto map = newest<nav_msgs::OccupancyGrid>("map");
  ASSERT_TRUE(map);
  EXPECT_EQ(map->header.frame_id, "map");
  EXPECT_EQ(map->data, (std::vector<std::int8_t>{100, -1, 0, 0, 0, 0}));
  EXPECT_DOUBLE_EQ(map->info.origin.position.y, 2.0);
  EXPECT_FLOAT_EQ(map->info.resolution, 0.05f);
  const auto metadata = newest<nav_msgs::MapMetaData>("map_metadata");
  ASSERT_TRUE(metadata);
  EXPECT_EQ(metadata->width, 3u);
  const auto distance = newest<kinect_nav::DistanceMap>("distance_map");
  ASSERT_TRUE(distance);
  EXPECT_EQ(distance->checksum, checksum);
  EXPECT_TRUE(std::isnan(distance->distance[1])) << "unknown";
  EXPECT_NEAR(distance->distance[2], 0.075f, 1e-6f);
  const auto keepout = newest<nav_msgs::OccupancyGrid>("keepout_map");
  ASSERT_TRUE(keepout);
  EXPECT_EQ(keepout->data, std::vector<std::int8_t>(6, 0));

  nav_msgs::GetMap get;
  ASSERT_TRUE(ros::service::call("static_map", get));
  EXPECT_EQ(get.response.map.data, map->data);
  kinect_nav::GetDistanceMap get_distance;
  ASSERT_TRUE(ros::service::call("get_distance_map", get_distance));
  EXPECT_EQ(get_distance.response.map.checksum, checksum);

  kinect_nav::LoadMap load;
  load.request.map_path = (folder / "none").string();
  ASSERT_TRUE(ros::service::call("load_map", load));
  EXPECT_FALSE(load.response.success);
  EXPECT_NE(load.response.message.find("no such map"), std::string::npos);
  ASSERT_TRUE(ros::service::call("static_map", get));
  EXPECT_EQ(get.response.map.info.width, 3u) << "the old map stays";

  load.request.map_path = second + "/map.yaml";
  ASSERT_TRUE(ros::service::call("load_map", load));
  EXPECT_TRUE(load.response.success) << load.response.message;
  EXPECT_EQ(newest<nav_msgs::OccupancyGrid>("map")->info.width, 5u);

  // save_map takes what is served.
  const std::string saved = (folder / "saved").string();
  const std::string command = std::string(SAVE_MAP) + " " + saved + " > /dev/null";
  ASSERT_EQ(WEXITSTATUS(std::system(command.c_str())), 0);
  EXPECT_EQ(load_map(saved).occupancy.value, map_of(5, 0).occupancy.value);
  fs::remove_all(folder);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_map_server");
  ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
