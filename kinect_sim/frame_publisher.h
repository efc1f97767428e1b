#pragma once

#include <ros/node_handle.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/LaserScan.h>

#include <vector>

#include "kinect_sim/simulator.h"
#include "kinect_sim/simulator_node_config.h"

namespace knav {

/// Renders depth frames and scans for whoever listens, and publishes them. Belongs to one thread.
class FramePublisher {
 public:
  FramePublisher(ros::NodeHandle& handle, Simulator& simulator, const SimulatorNodeConfig& config);

  bool anybody_listens() const;
  bool depth_is_wanted() const { return image_.getNumSubscribers() + info_.getNumSubscribers() > 0; }
  void publish(const FrameRequest& request);

 private:
  sensor_msgs::ImagePtr free_image();
  void publish_scan(ros::Publisher& publisher, const char* frame);

  Simulator& simulator_;
  SimulatorNodeConfig config_;
  ros::Publisher image_, info_, lidar_, perfect_, range_;
  std::vector<sensor_msgs::ImagePtr> pool_;  ///< images that subscribers have let go of are used again
  RangeScan scan_;
};

}  // namespace knav
