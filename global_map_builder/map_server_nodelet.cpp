#include <kinect_nav/DistanceMap.h>
#include <kinect_nav/GetDistanceMap.h>
#include <kinect_nav/LoadMap.h>
#include <nav_msgs/GetMap.h>
#include <nav_msgs/OccupancyGrid.h>
#include <nav_msgs/SetMap.h>
#include <ros/ros.h>

#include <mutex>
#include <pluginlib/class_list_macros.hpp>

#include "global_map_builder/map_directory.h"
#include "global_map_builder/map_server_config.h"
#include "ros_common/conversions.h"
#include "ros_common/nodelet_base.h"
#include "ros_common/parameters.h"

namespace knav {

/// Serves a map directory, or a plain map_server map: map, map_metadata, distance_map, keepout_map (latched)
/// and the services static_map, get_distance_map, load_map.
class MapServerNodelet : public NodeletBase {
 protected:
  void start() override {
    ros::NodeHandle& node = getNodeHandle();
    config_ = read_parameters<MapServerConfig>(getPrivateNodeHandle());
    map_publisher_ = node.advertise<nav_msgs::OccupancyGrid>("map", 1, true);
    metadata_publisher_ = node.advertise<nav_msgs::MapMetaData>("map_metadata", 1, true);
    distance_publisher_ = node.advertise<kinect_nav::DistanceMap>("distance_map", 1, true);
    keepout_publisher_ = node.advertise<nav_msgs::OccupancyGrid>("keepout_map", 1, true);
    if (!config_.map_path.empty()) serve(load_map(config_.map_path));
    static_map_ = node.advertiseService("static_map", &MapServerNodelet::on_static_map, this);
    get_distance_map_ = node.advertiseService("get_distance_map", &MapServerNodelet::on_distance_map, this);
    load_map_ = node.advertiseService("load_map", &MapServerNodelet::on_load_map, this);
    if (config_.map_path.empty()) NODELET_INFO("No map_path; waiting for the service load_map.");
  }

 private:
  void serve(const MapDirectory& map) {
    for (const std::string& warning : map.warnings) NODELET_WARN("%s", warning.c_str());
    const auto occupancy = boost::make_shared<nav_msgs::OccupancyGrid>();
    const auto keepout = boost::make_shared<nav_msgs::OccupancyGrid>();
    const auto distance = boost::make_shared<kinect_nav::DistanceMap>();
    occupancy_message(map.occupancy, occupancy.get());
    occupancy_message(map.keepout, keepout.get());
    distance_map_message(map.distance, distance.get());
    const ros::Time now = ros::Time::now();
    for (std_msgs::Header* header : {&occupancy->header, &keepout->header, &distance->header}) {
      header->frame_id = config_.frame_id;
      header->stamp = now;
    }
    occupancy->info.map_load_time = keepout->info.map_load_time = distance->info.map_load_time = now;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      occupancy_ = occupancy;
      distance_ = distance;
    }
    // The distance map last: whoever has it has the others of the same map on the way.
    metadata_publisher_.publish(occupancy->info);
    map_publisher_.publish(nav_msgs::OccupancyGrid::ConstPtr(occupancy));
    keepout_publisher_.publish(nav_msgs::OccupancyGrid::ConstPtr(keepout));
    distance_publisher_.publish(kinect_nav::DistanceMap::ConstPtr(distance));
    NODELET_INFO("Serving a map of %u x %u cells at %.3f m, checksum %s.", occupancy->info.width,
                 occupancy->info.height, static_cast<double>(occupancy->info.resolution),
                 map.checksum.c_str());
  }

  bool on_static_map(nav_msgs::GetMap::Request&, nav_msgs::GetMap::Response& response) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!occupancy_) return false;
    response.map = *occupancy_;
    return true;
  }

  bool on_distance_map(kinect_nav::GetDistanceMap::Request&, kinect_nav::GetDistanceMap::Response& response) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!distance_) return false;
    response.map = *distance_;
    return true;
  }

  bool on_load_map(kinect_nav::LoadMap::Request& request, kinect_nav::LoadMap::Response& response) {
    try {
      const MapDirectory map = load_map(request.map_path);
      serve(map);
      response.success = true;
      response.message = "serving " + request.map_path + ", checksum " + map.checksum;
      if (request.has_pose) set_pose(request.pose, &response);
    } catch (const std::exception& error) {
      response.success = false;
      response.message = error.what();  // the old map stays
    }
    return true;
  }

  /// The localizer takes map and pose together by amcl's service; without one the pose goes to `initialpose`.
  void set_pose(const geometry_msgs::PoseWithCovariance& pose, kinect_nav::LoadMap::Response* response) {
    nav_msgs::SetMap call;
    call.request.map = *occupancy_;
    call.request.initial_pose.header = occupancy_->header;
    call.request.initial_pose.pose = pose;
    if (ros::service::exists("set_map", false) && ros::service::call("set_map", call) &&
        call.response.success)
      return;
    response->message += "; but no localizer took the pose (service set_map)";
  }

  MapServerConfig config_;
  std::mutex mutex_;
  nav_msgs::OccupancyGrid::ConstPtr occupancy_;
  kinect_nav::DistanceMap::ConstPtr distance_;
  ros::Publisher map_publisher_, metadata_publisher_, distance_publisher_, keepout_publisher_;
  ros::ServiceServer static_map_, get_distance_map_, load_map_;
};

}  // namespace knav

PLUGINLIB_EXPORT_CLASS(knav::MapServerNodelet, nodelet::Nodelet)
