#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "kinect_calib/depth_corrector.h"
#include "kinect_calib/depth_messages.h"
#include "ros_common/message_pool.h"
#include "ros_common/nodelet_base.h"
#include "ros_common/on_demand.h"
#include "ros_common/parameters.h"

namespace knav {

/// camera/depth/image_raw + camera_info -> camera/depth/image_rect + camera_info_rect.
class DepthCorrectionNodelet : public NodeletBase {
 private:
  void start() override {
    node_ = getNodeHandle();
    corrector_ =
        std::make_unique<DepthCorrector>(read_parameters<DepthCorrectionConfig>(getPrivateNodeHandle()));
    if (corrector_->uncalibrated()) {
      NODELET_WARN(
          "%s: no calibration_file: depth passes uncorrected and may be 10 %% wrong at 10 m; make one with "
          "calibrate_depth.",
          getName().c_str());
    }
    demand_ = std::make_unique<OnDemand>(
        [this] {
          info_subscriber_ =
              node_.subscribe("camera/depth/camera_info", 8, &DepthCorrectionNodelet::on_info, this);
          image_subscriber_ =
              node_.subscribe("camera/depth/image_raw", 8, &DepthCorrectionNodelet::on_image, this);
        },
        [this] {
          image_subscriber_.shutdown();
          info_subscriber_.shutdown();
        });
    info_publisher_ = demand_->advertise<sensor_msgs::CameraInfo>(node_, "camera/depth/camera_info_rect", 8);
    image_publisher_ = demand_->advertise<sensor_msgs::Image>(node_, "camera/depth/image_rect", 8);
  }

  void on_info(const sensor_msgs::CameraInfoConstPtr& info) {
    info_ = info;
    camera_ = raw_camera_from(*info);
  }

  void on_image(const sensor_msgs::ImageConstPtr& image) {
    if (!info_) {
      NODELET_WARN_THROTTLE(5.0, "%s: depth images come, but nothing on %s.", getName().c_str(),
                            info_subscriber_.getTopic().c_str());
      return;
    }
    cv::Mat raw;
    std::string fault;
    if (!view_depth(*image, &raw, &fault)) {
      NODELET_WARN_THROTTLE(5.0, "%s: %s", getName().c_str(), fault.c_str());
      return;
    }
    const auto rectified = images_.take();
    cv::Mat corrected = make_depth_message(image->header, raw.cols, raw.rows, rectified.get());
    if (!corrector_->correct(raw, camera_, &corrected)) {
      NODELET_WARN_THROTTLE(5.0, "%s: %s", getName().c_str(), corrector_->fault().c_str());
      return;
    }
    const auto info = infos_.take();
    rectified_info(*info_, camera_.rectified, info.get());
    info->header = image->header;
    info_publisher_.publish(info);
    image_publisher_.publish(rectified);
  }

  ros::NodeHandle node_;
  std::unique_ptr<DepthCorrector> corrector_;
  std::unique_ptr<OnDemand> demand_;
  ros::Subscriber image_subscriber_, info_subscriber_;
  ros::Publisher image_publisher_, info_publisher_;
  sensor_msgs::CameraInfoConstPtr info_;
  RawCamera camera_;
  MessagePool<sensor_msgs::Image> images_;
  MessagePool<sensor_msgs::CameraInfo> infos_;
};

}  // namespace knav

PLUGINLIB_EXPORT_CLASS(knav::DepthCorrectionNodelet, nodelet::Nodelet)
