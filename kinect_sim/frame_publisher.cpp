#include "kinect_sim/frame_publisher.h"

#include <algorithm>
#include <cmath>

#include "kinect_sim/sim_messages.h"
#include "ros_common/conversions.h"

namespace knav {

FramePublisher::FramePublisher(ros::NodeHandle& handle, Simulator& simulator,
                               const SimulatorNodeConfig& config)
    : simulator_(&simulator), config_(config) {
  if (config.openni2_device.empty()) {
    image_ = handle.advertise<sensor_msgs::Image>("camera/depth/image_raw", 4);
    info_ = handle.advertise<sensor_msgs::CameraInfo>("camera/depth/camera_info", 4);
    infrared_ = handle.advertise<sensor_msgs::Image>("camera/ir/image", 4);
    infrared_info_ = handle.advertise<sensor_msgs::CameraInfo>("camera/ir/camera_info", 4);
  } else {
    openni2_ = std::make_unique<OpenNI2Output>(config.openni2_device, simulator);
  }
  lidar_ = handle.advertise<sensor_msgs::LaserScan>("lidar_scan", 4);
  range_ = handle.advertise<sensor_msgs::Range>("range", 4);
  perfect_ = handle.advertise<sensor_msgs::LaserScan>("perfect_scan_360", 4);
}

bool FramePublisher::anybody_listens() const {
  return depth_is_wanted() || infrared_.getNumSubscribers() > 0 || (openni2_ && openni2_->wanted()) || lidar_.getNumSubscribers() > 0 || perfect_.getNumSubscribers() > 0 ||
         range_.getNumSubscribers() > 0;
}

sensor_msgs::ImagePtr FramePublisher::free_image() {
  for (const sensor_msgs::ImagePtr& image : pool_) {
    if (image.use_count() == 1) return image;
  }
  sensor_msgs::ImagePtr image(new sensor_msgs::Image);
  prepare_depth_message(simulator_->camera(), image.get());
  if (pool_.size() < 32) pool_.push_back(image);
  return image;
}

void FramePublisher::publish_depth(const FrameRequest& request) {
  const sensor_msgs::ImagePtr image = free_image();
  image->encoding = "16UC1";
  cv::Mat view = depth_view(image.get());
  simulator_->render(request, &view);
  image->header.stamp.fromSec(request.stamp_s);
  info_.publish(camera_info_message(simulator_->camera(), request.stamp_s));
  image_.publish(image);
}

void FramePublisher::publish_infrared(const FrameRequest& request) {
  const sensor_msgs::ImagePtr image = free_image();
  image->encoding = "mono16";
  cv::Mat view = depth_view(image.get());
  simulator_->render_infrared(request, &view);
  image->header.stamp.fromSec(request.stamp_s);
  infrared_info_.publish(camera_info_message(simulator_->infrared_camera(), request.stamp_s));
  infrared_.publish(image);
}

void FramePublisher::publish(const FrameRequest& request) {
  if (openni2_) openni2_->render(*simulator_, request);
  if (depth_is_wanted()) publish_depth(request);
  if (infrared_.getNumSubscribers() > 0) publish_infrared(request);
  const auto every =
      static_cast<std::uint64_t>(std::max(1L, std::lround(config_.frame_rate_hz / config_.scan_rate_hz)));
  if (request.index % every != 0) return;
  if (lidar_.getNumSubscribers() > 0) {
    simulator_->scan_lidar(request, &scan_);
    publish_scan(lidar_, "laser");
  }
  if (range_.getNumSubscribers() > 0) range_.publish(range_message(*simulator_, request));
  if (perfect_.getNumSubscribers() > 0) {
    simulator_->scan_perfect(request, config_.perfect_scan_height_m, &scan_);
    publish_scan(perfect_, "base_link");
  }
}

void FramePublisher::publish_scan(ros::Publisher& publisher, const char* frame) {
  const sensor_msgs::LaserScanPtr message(new sensor_msgs::LaserScan);
  scan_message(scan_, message.get());
  message->header.frame_id = frame;
  publisher.publish(message);
}

}  // namespace knav
