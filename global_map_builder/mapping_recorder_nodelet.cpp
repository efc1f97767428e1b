// Records what build_map needs while the robot is driven around, with the first seconds of raw depth. As a nodelet
// beside the camera it gets the images as pointers: 18 MB a second less to serialise than a recorder of its own.
#include <pluginlib/class_list_macros.hpp>
#include <ros/ros.h>
#include <rosbag/bag.h>
#include <sensor_msgs/Image.h>
#include <tf2_msgs/TFMessage.h>
#include <topic_tools/shape_shifter.h>

#include <cstdio>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/config.h"
#include "global_map_builder/mapping_recorder_config.h"
#include "ros_common/nodelet_base.h"
#include "ros_common/parameters.h"

namespace knav {
class MappingRecorderNodelet : public NodeletBase {
 public:
  ~MappingRecorderNodelet() override {
    std::lock_guard<std::mutex> lock(mutex_);
    close();
  }

 private:
  void start() override {
    config_ = read_parameters<MappingRecorderConfig>(getPrivateNodeHandle());
    part_ = config_.bag + ".part";
    try {
      bag_.open(part_, rosbag::bagmode::Write);
    } catch (const rosbag::BagException& error) {
      throw UserError(config_.bag + ": cannot be written (" + error.what() + ").");
    }
    open_ = true;
    for (const char* topic : {"depth_profile", "odom", "/tf", "mark_place", "ground_truth", "joy",
                              "camera/depth/camera_info"}) {
      subscribe<topic_tools::ShapeShifter>(topic);
    }
    // By its type: a latched message of this very process does not reach a ShapeShifter.
    subscribe<tf2_msgs::TFMessage>("/tf_static");
    if (config_.depth_s > 0.0) {
      depth_subscriber_ = getNodeHandle().subscribe<sensor_msgs::Image>(
          "camera/depth/image_raw", 60, [this](const sensor_msgs::ImageConstPtr& image) { add_depth(image); });
    }
    NODELET_INFO("Recording to %s.", config_.bag.c_str());
  }

  template <class Message>
  void subscribe(const std::string& topic) {
    const std::string resolved = getNodeHandle().resolveName(topic);
    using Event = ros::MessageEvent<Message const>;
    subscribers_.push_back(getNodeHandle().subscribe<Message>(
        resolved, 1000, boost::function<void(const Event&)>([this, resolved](const Event& event) {
          write(resolved, event.getReceiptTime(), *event.getConstMessage(), event.getConnectionHeaderPtr());
        })));
  }

  void add_depth(const sensor_msgs::ImageConstPtr& image) {
    if (first_depth_.isZero()) first_depth_ = image->header.stamp;
    if ((image->header.stamp - first_depth_).toSec() > config_.depth_s) {
      depth_subscriber_.shutdown();
      return;
    }
    write(getNodeHandle().resolveName("camera/depth/image_raw"), image->header.stamp, *image, nullptr);
  }

  template <class Message>
  void write(const std::string& topic, ros::Time time, const Message& message,
             const boost::shared_ptr<ros::M_string>& connection_header) {
    std::lock_guard<std::mutex> lock(mutex_);
    if (!open_ || time.isZero()) return;
    try {
      bag_.write(topic, time, message, connection_header);
    } catch (const rosbag::BagException& error) {
      NODELET_FATAL("Recording stopped: %s: %s. What was written is kept.", config_.bag.c_str(), error.what());
      close();
    }
  }

  void close() {
    if (!open_) return;
    open_ = false;
    try {
      bag_.close();
      if (std::rename(part_.c_str(), config_.bag.c_str()) != 0) {
        NODELET_ERROR("%s cannot be renamed to %s.", part_.c_str(), config_.bag.c_str());
      }
    } catch (const rosbag::BagException& error) {
      NODELET_ERROR("%s: not closed: %s.", part_.c_str(), error.what());
    }
  }

  MappingRecorderConfig config_;
  std::mutex mutex_;
  rosbag::Bag bag_;
  bool open_ = false;
  std::string part_;
  ros::Time first_depth_;
  ros::Subscriber depth_subscriber_;
  std::vector<ros::Subscriber> subscribers_;
};

}  // namespace knav

PLUGINLIB_EXPORT_CLASS(knav::MappingRecorderNodelet, nodelet::Nodelet)
