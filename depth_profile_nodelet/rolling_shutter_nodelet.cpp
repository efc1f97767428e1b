#include <nav_msgs/Odometry.h>

#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "depth_profile_nodelet/rolling_shutter.h"
#include "kinect_calib/depth_messages.h"
#include "ros_common/clock_watch.h"
#include "ros_common/conversions.h"
#include "ros_common/message_pool.h"
#include "ros_common/nodelet_base.h"
#include "ros_common/on_demand.h"
#include "ros_common/parameters.h"

namespace knav {

/// camera/depth/image_rect + camera_info_rect + odom -> camera/depth/image_unrolled. An image in which
/// nothing has to move goes on as the same pointer.
class RollingShutterNodelet : public NodeletBase {
 private:
  void start() override {
    node_ = getNodeHandle();
    corrector_ = std::make_unique<RollingShutterCorrector>(
        read_parameters<RollingShutterConfig>(getPrivateNodeHandle()));
    demand_ = std::make_unique<OnDemand>(
        [this] {
          odometry_subscriber_ = node_.subscribe("odom", 50, &RollingShutterNodelet::on_odometry, this);
          info_subscriber_ =
              node_.subscribe("camera/depth/camera_info_rect", 8, &RollingShutterNodelet::on_info, this);
          image_subscriber_ =
              node_.subscribe("camera/depth/image_rect", 8, &RollingShutterNodelet::on_image, this);
        },
        [this] {
          image_subscriber_.shutdown();
          info_subscriber_.shutdown();
          odometry_subscriber_.shutdown();
        });
    publisher_ = demand_->advertise<sensor_msgs::Image>(node_, "camera/depth/image_unrolled", 8);
  }

  void on_odometry(const nav_msgs::OdometryConstPtr& odometry) {
    const double stamp_s = odometry->header.stamp.toSec();
    if (clock_.jumped_back(stamp_s)) {
      NODELET_WARN("%s: the clock jumped back; odometry starts anew.", getName().c_str());
      poses_.clear();
    }
    const Pose2 pose = pose2_from(odometry->pose.pose);
    if (is_finite(pose)) poses_.add(stamp_s, pose);
  }

  void on_info(const sensor_msgs::CameraInfoConstPtr& info) { camera_ = pinhole_from(*info); }

  void on_image(const sensor_msgs::ImageConstPtr& image) {
    cv::Mat depth;
    std::string fault;
    if (!view_depth(*image, &depth, &fault) || depth.type() != CV_32FC1) {
      NODELET_WARN_THROTTLE(5.0, "%s: %s", getName().c_str(),
                            fault.empty() ? "image_rect must be 32FC1." : fault.c_str());
      return;
    }
    if (!camera_.valid() || camera_.width_px != depth.cols || camera_.height_px != depth.rows) {
      NODELET_WARN_THROTTLE(5.0, "%s: no camera_info_rect of the image's size yet.", getName().c_str());
      return;
    }
    const auto message = images_.take();
    cv::Mat unrolled = make_depth_message(image->header, depth.cols, depth.rows, message.get());
    using Outcome = RollingShutterCorrector::Outcome;
    const Outcome outcome =
        corrector_->correct(depth, camera_, image->header.stamp.toSec(), poses_, &unrolled);
    if (outcome == Outcome::kNoOdometry) {
      NODELET_WARN_THROTTLE(5.0,
                            "%s: no odometry at the image's stamp: the rolling shutter stays uncorrected.",
                            getName().c_str());
    }
    if (outcome == Outcome::kCorrected) {
      publisher_.publish(message);
    } else {
      publisher_.publish(image);
    }
  }

  ros::NodeHandle node_;
  std::unique_ptr<RollingShutterCorrector> corrector_;
  std::unique_ptr<OnDemand> demand_;
  ros::Subscriber image_subscriber_, info_subscriber_, odometry_subscriber_;
  ros::Publisher publisher_;
  PinholeModel camera_;
  PoseBuffer poses_;
  ClockWatch clock_;
  MessagePool<sensor_msgs::Image> images_;
};

}  // namespace knav

PLUGINLIB_EXPORT_CLASS(knav::RollingShutterNodelet, nodelet::Nodelet)
