#include <kinect_nav/FloorPlane.h>

#include <algorithm>
#include <array>
#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "depth_profile_nodelet/profile_extractor.h"
#include "kinect_calib/depth_messages.h"
#include "ros_common/conversions.h"
#include "ros_common/message_pool.h"
#include "ros_common/nodelet_base.h"
#include "ros_common/on_demand.h"
#include "ros_common/parameters.h"

namespace knav {

/// camera/depth/image_sliced + camera_info_rect + floor (of the same stamp) -> depth_profile + scan.
class DepthProfileNodelet : public NodeletBase {
 private:
  void start() override {
    node_ = getNodeHandle();
    config_ = read_parameters<DepthProfileConfig>(getPrivateNodeHandle());
    extractor_ = std::make_unique<ProfileExtractor>(config_);
    demand_ = std::make_unique<OnDemand>(
        [this] {
          info_subscriber_ =
              node_.subscribe("camera/depth/camera_info_rect", 8, &DepthProfileNodelet::on_info, this);
          floor_subscriber_ = node_.subscribe("floor", 8, &DepthProfileNodelet::on_floor, this);
          image_subscriber_ =
              node_.subscribe("camera/depth/image_sliced", 8, &DepthProfileNodelet::on_image, this);
        },
        [this] {
          image_subscriber_.shutdown();
          floor_subscriber_.shutdown();
          info_subscriber_.shutdown();
        });
    profile_publisher_ = demand_->advertise<kinect_nav::DepthProfile>(node_, "depth_profile", 8);
    scan_publisher_ = demand_->advertise<sensor_msgs::LaserScan>(node_, "scan", 8);
  }

  void on_info(const sensor_msgs::CameraInfoConstPtr& info) { camera_ = pinhole_from(*info); }

  void on_floor(const kinect_nav::FloorPlaneConstPtr& floor) {
    floors_[next_floor_++ % floors_.size()] = floor;
    match();
  }

  void on_image(const sensor_msgs::ImageConstPtr& image) {
    images_[next_image_++ % images_.size()] = image;
    match();
  }

  /// Floor and image come on two topics, in either order.
  void match() {
    for (sensor_msgs::ImageConstPtr& image : images_) {
      if (!image) continue;
      const auto floor =
          std::find_if(floors_.begin(), floors_.end(), [&](const kinect_nav::FloorPlaneConstPtr& f) {
            return f && f->header.stamp == image->header.stamp;
          });
      if (floor == floors_.end()) continue;
      process(*image, **floor);
      image.reset();
      floor->reset();
    }
  }

  void process(const sensor_msgs::Image& image, const kinect_nav::FloorPlane& floor) {
    cv::Mat sliced;
    std::string fault;
    if (!view_depth(image, &sliced, &fault) || sliced.type() != CV_32FC1) {
      NODELET_WARN_THROTTLE(5.0, "%s: %s", getName().c_str(),
                            fault.empty() ? "image_sliced must be 32FC1." : fault.c_str());
      return;
    }
    if (!camera_.valid() || camera_.width_px != sliced.cols) {
      NODELET_WARN_THROTTLE(5.0, "%s: no camera_info_rect of the image's width yet.", getName().c_str());
      return;
    }
    height_class_.resize(floor.height_class.size());
    for (std::size_t u = 0; u < height_class_.size(); ++u) {
      height_class_[u] = static_cast<HeightClass>(std::min<int>(floor.height_class[u], 4));
    }
    extractor_->extract(sliced, camera_, image.header.stamp.toSec(), floor.height_m, floor.free_from,
                        floor.free_to, height_class_, &profile_);
    if (profile_publisher_.getNumSubscribers() > 0) {
      const auto message = profiles_.take();
      profile_message(profile_, message.get());
      message->header = image.header;
      profile_publisher_.publish(message);
    }
    if (scan_publisher_.getNumSubscribers() > 0) {
      scan_from_profile(profile_, config_, &scan_);
      const auto message = scans_.take();
      scan_message(scan_, message.get());
      message->header.stamp = image.header.stamp;
      message->header.frame_id = config_.scan_frame;
      scan_publisher_.publish(message);
    }
  }

  ros::NodeHandle node_;
  DepthProfileConfig config_;
  std::unique_ptr<ProfileExtractor> extractor_;
  std::unique_ptr<OnDemand> demand_;
  ros::Subscriber image_subscriber_, info_subscriber_, floor_subscriber_;
  ros::Publisher profile_publisher_, scan_publisher_;
  PinholeModel camera_;
  std::array<kinect_nav::FloorPlaneConstPtr, 4> floors_;
  std::array<sensor_msgs::ImageConstPtr, 4> images_;
  std::size_t next_floor_ = 0, next_image_ = 0;
  std::vector<HeightClass> height_class_;
  DepthProfile profile_;
  RangeScan scan_;
  MessagePool<kinect_nav::DepthProfile> profiles_;
  MessagePool<sensor_msgs::LaserScan> scans_;
};

}  // namespace knav

PLUGINLIB_EXPORT_CLASS(knav::DepthProfileNodelet, nodelet::Nodelet)
