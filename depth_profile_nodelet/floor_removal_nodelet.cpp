#include <kinect_nav/FloorPlane.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <memory>
#include <pluginlib/class_list_macros.hpp>

#include "depth_profile_nodelet/floor_remover.h"
#include "kinect_calib/depth_messages.h"
#include "ros_common/clock_watch.h"
#include "ros_common/conversions.h"
#include "ros_common/message_pool.h"
#include "ros_common/nodelet_base.h"
#include "ros_common/on_demand.h"
#include "ros_common/parameters.h"

namespace knav {
namespace {

Eigen::Isometry3d isometry_from(const geometry_msgs::Transform& transform) {
  const auto& q = transform.rotation;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized().toRotationMatrix();
  T.translation() =
      Eigen::Vector3d(transform.translation.x, transform.translation.y, transform.translation.z);
  return T;
}

void floor_message(const FloorResult& floor, kinect_nav::FloorPlane* message) {
  message->normal_x = static_cast<float>(floor.plane.up.x());
  message->normal_y = static_cast<float>(floor.plane.up.y());
  message->normal_z = static_cast<float>(floor.plane.up.z());
  message->height_m = static_cast<float>(floor.plane.height_m);
  message->source = static_cast<std::uint8_t>(floor.source);
  message->vote_fraction = static_cast<float>(floor.vote_fraction);
  message->free_from = floor.free_from_m;
  message->free_to = floor.free_to_m;
  message->height_class.resize(floor.height_class.size());
  for (std::size_t u = 0; u < floor.height_class.size(); ++u) {
    message->height_class[u] = static_cast<std::uint8_t>(floor.height_class[u]);
  }
}

}  // namespace

/// camera/depth/image_unrolled + camera_info_rect + TF -> camera/depth/image_sliced + floor.
class FloorRemovalNodelet : public NodeletBase {
 private:
  void start() override {
    node_ = getNodeHandle();
    config_ = read_parameters<FloorRemovalConfig>(getPrivateNodeHandle());
    remover_ = std::make_unique<FloorRemover>(config_);
    listener_ = std::make_unique<tf2_ros::TransformListener>(transforms_);
    demand_ = std::make_unique<OnDemand>(
        [this] {
          info_subscriber_ =
              node_.subscribe("camera/depth/camera_info_rect", 8, &FloorRemovalNodelet::on_info, this);
          image_subscriber_ =
              node_.subscribe("camera/depth/image_unrolled", 8, &FloorRemovalNodelet::on_image, this);
        },
        [this] {
          image_subscriber_.shutdown();
          info_subscriber_.shutdown();
        });
    floor_publisher_ = demand_->advertise<kinect_nav::FloorPlane>(node_, "floor", 8);
    image_publisher_ = demand_->advertise<sensor_msgs::Image>(node_, "camera/depth/image_sliced", 8);
  }

  void on_info(const sensor_msgs::CameraInfoConstPtr& info) { camera_ = pinhole_from(*info); }

  void on_image(const sensor_msgs::ImageConstPtr& image) {
    cv::Mat depth;
    std::string fault;
    if (!view_depth(*image, &depth, &fault) || depth.type() != CV_32FC1) {
      NODELET_WARN_THROTTLE(5.0, "%s: %s", getName().c_str(),
                            fault.empty() ? "image_unrolled must be 32FC1." : fault.c_str());
      return;
    }
    if (!camera_.valid() || camera_.width_px != depth.cols || camera_.height_px != depth.rows) {
      NODELET_WARN_THROTTLE(5.0, "%s: no camera_info_rect of the image's size yet.", getName().c_str());
      return;
    }
    if (clock_.jumped_back(image->header.stamp.toSec())) {
      NODELET_WARN("%s: the clock jumped back; the floor of earlier frames is forgotten.", getName().c_str());
      remover_->reset();
      transforms_.clear();
    }
    Eigen::Isometry3d T_base_optical;
    try {
      T_base_optical =
          isometry_from(transforms_
                            .lookupTransform(config_.base_frame, image->header.frame_id, image->header.stamp,
                                             ros::Duration(config_.tf_timeout_s))
                            .transform);
    } catch (const tf2::TransformException& error) {
      NODELET_WARN_THROTTLE(5.0, "%s: frames wait for the camera's mount (TF %s -> %s): %s",
                            getName().c_str(), config_.base_frame.c_str(), image->header.frame_id.c_str(),
                            error.what());
      return;
    }
    const auto message = images_.take();
    cv::Mat sliced = make_depth_message(image->header, depth.cols, depth.rows, message.get());
    remover_->process(depth, camera_, image->header.stamp.toSec(), T_base_optical, &sliced, &floor_);
    const auto floor = floors_.take();
    floor->header = image->header;
    floor_message(floor_, floor.get());
    floor_publisher_.publish(floor);
    image_publisher_.publish(message);
  }

  ros::NodeHandle node_;
  FloorRemovalConfig config_;
  std::unique_ptr<FloorRemover> remover_;
  tf2_ros::Buffer transforms_;
  std::unique_ptr<tf2_ros::TransformListener> listener_;
  std::unique_ptr<OnDemand> demand_;
  ros::Subscriber image_subscriber_, info_subscriber_;
  ros::Publisher image_publisher_, floor_publisher_;
  PinholeModel camera_;
  FloorResult floor_;
  ClockWatch clock_;
  MessagePool<sensor_msgs::Image> images_;
  MessagePool<kinect_nav::FloorPlane> floors_;
};

}  // namespace knav

PLUGINLIB_EXPORT_CLASS(knav::FloorRemovalNodelet, nodelet::Nodelet)
