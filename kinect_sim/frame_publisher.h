#pragma once

#include <ros/node_handle.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/LaserScan.h>

#include <memory>
#include <vector>

#include "kinect_sim/openni2_output.h"
#include "kinect_sim/simulator.h"
#include "kinect_sim/simulator_node_config.h"

namespace knav {

/// Renders images and scans for whoever listens, and publishes them, or hands the images to OpenNI2. Belongs to one
/// thread.
class FramePublisher {
 public:
  FramePublisher(ros::NodeHandle& handle, Simulator& simulator, const SimulatorNodeConfig& config);

  /// Renders another one from now on: the next run of a benchmark. Not for an OpenNI2 device.
  void show(Simulator& simulator) { simulator_ = &simulator; }

  /// Null unless the Kinect is shown as an OpenNI2 device.
  OpenNI2Output* openni2() { return openni2_.get(); }

  bool anybody_listens() const;
  bool depth_is_wanted() const { return image_.getNumSubscribers() + info_.getNumSubscribers() > 0; }
  void publish(const FrameRequest& request);

 private:
  void publish_depth(const FrameRequest& request);
  void publish_infrared(const FrameRequest& request);
  sensor_msgs::ImagePtr free_image();
  void publish_scan(ros::Publisher& publisher, const char* frame);

  Simulator* simulator_;
  SimulatorNodeConfig config_;
  std::unique_ptr<OpenNI2Output> openni2_;
  ros::Publisher image_, info_, infrared_, infrared_info_, lidar_, perfect_, range_;
  std::vector<sensor_msgs::ImagePtr> pool_;  ///< images that subscribers have let go of are used again
  RangeScan scan_;
};

}  // namespace knav
