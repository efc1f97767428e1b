// save_map: a live map topic (ours, or anyone's) as a map directory, as map_saver does.
#include <fmt/format.h>
#include <kinect_nav/DistanceMap.h>
#include <nav_msgs/OccupancyGrid.h>
#include <ros/ros.h>

#include <cmath>

#include "core/error.h"
#include "core/occupancy_distance.h"
#include "global_map_builder/map_directory.h"
#include "ros_common/command_line.h"
#include "ros_common/conversions.h"

namespace knav {
namespace {

struct Options {
  std::string out, topic = "map", distance_topic = "distance_map", keepout_topic = "keepout_map";
  double timeout_s = 10.0;
  bool force = false;
};

/// Waits for the (latched) messages; the map is needed, the others are taken if they come within a second of
/// it.
void save(const Options& options) {
  if (!ros::master::check()) throw UserError("no ROS master answers; start roscore or set ROS_MASTER_URI.");
  ros::NodeHandle node;
  nav_msgs::OccupancyGrid::ConstPtr occupancy, keepout;
  kinect_nav::DistanceMap::ConstPtr distance;
  using Grid = nav_msgs::OccupancyGrid;
  const auto map_subscriber =
      node.subscribe<Grid>(options.topic, 1, [&](const Grid::ConstPtr& m) { occupancy = m; });
  const auto keepout_subscriber =
      node.subscribe<Grid>(options.keepout_topic, 1, [&](const Grid::ConstPtr& m) { keepout = m; });
  const auto distance_subscriber = node.subscribe<kinect_nav::DistanceMap>(
      options.distance_topic, 1, [&](const kinect_nav::DistanceMap::ConstPtr& m) { distance = m; });
  const auto start = ros::WallTime::now();
  ros::WallTime got;
  while ((ros::WallTime::now() - start).toSec() < options.timeout_s) {
    stop_if_interrupted();
    ros::spinOnce();
    if (occupancy && got.isZero()) got = ros::WallTime::now();
    if (occupancy && ((distance && keepout) || (ros::WallTime::now() - got).toSec() > 1.0)) break;
    ros::WallDuration(0.02).sleep();
  }
  if (!occupancy) {
    throw UserError(
        fmt::format("no map came on topic '{}' within {:.0f} s; is a map server or mapper running?",
                    node.resolveName(options.topic), options.timeout_s));
  }
  MapDirectory map;
  map.occupancy = occupancy_from(*occupancy);
  map.about["made_by"] = "save_map";
  map.about["topic"] = node.resolveName(options.topic);
  // map_server's format knows three values; these are map_saver's default limits.
  for (std::int8_t& v : map.occupancy.value) v = v < 0 || (v > 19 && v < 65) ? -1 : v <= 19 ? 0 : 100;
  const auto same_size = [&](const GridGeometry& g) {
    return g.width_cells == map.occupancy.geometry.width_cells &&
           g.height_cells == map.occupancy.geometry.height_cells;
  };
  map.distance = distance ? distance_map_from(*distance) : distance_from_occupancy(map.occupancy);
  if (!same_size(map.distance.geometry)) map.distance = distance_from_occupancy(map.occupancy);
  if (keepout) map.keepout = occupancy_from(*keepout);
  if (!same_size(map.keepout.geometry)) map.keepout = {};
  const std::string checksum = save_map(options.out, map, options.force);
  fmt::print("{}: {} x {} cells, checksum {}\n", options.out, map.occupancy.geometry.width_cells,
             map.occupancy.geometry.height_cells, checksum);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  ros::init(argc, argv, "save_map", ros::init_options::AnonymousName | ros::init_options::NoSigintHandler);
  CLI::App app("Saves the map on a live topic as a map directory; topics can also be remapped (map:=other).");
  knav::Options options;
  app.add_option("DIR", options.out, "map directory to write")->required();
  app.add_option("--topic", options.topic, "nav_msgs/OccupancyGrid")->capture_default_str();
  app.add_option("--timeout", options.timeout_s, "seconds to wait for it")->capture_default_str();
  app.add_flag("--force", options.force,
               "replace a map even if its keepout.pgm or places.yaml were edited by hand");
  return knav::run_command(app, argc, argv, [&] { knav::save(options); });
}
