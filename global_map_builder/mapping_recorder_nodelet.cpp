// Records what build_map needs while the robot is driven around, with the first seconds of raw depth. As a
// nodelet beside the camera it gets the images as pointers: 18 MB a second less to serialise than a recorder
// of its own.
#include <ros/ros.h>
#include <rosbag/bag.h>
#include <sensor_msgs/Image.h>
#include <tf2_msgs/TFMessage.h>
#include <topic_tools/shape_shifter.h>

#include <cstdio>
#include <memory>
#include <mutex>
#include <pluginlib/class_list_macros.hpp>
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
    for (const char* topic :
         {"depth_profile", "odom", "/tf", "mark_place", "ground_truth", "joy", "camera/depth/camera_info"}) {
      subscribe<topic_tools::ShapeShifter>(topic);
    }
    // By its type: a latched message of this very process does not reach a ShapeShifter.
    static_tf_subscriber_ = getNodeHandle().subscribe<tf2_msgs::TFMessage>(
        "/tf_static", 100, [this](const tf2_msgs::TFMessageConstPtr& message) { add_static(*message); });
    if (config_.depth_s > 0.0) {
      depth_subscriber_ = getNodeHandle().subscribe<sensor_msgs::Image>(
          "camera/depth/image_raw", 60,
          [this](const sensor_msgs::ImageConstPtr& image) { add_depth(image); });
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

  /// Latched, so it often comes before simulated time has begun: it is kept until there is a time to write it
  /// at.
  void add_static(const tf2_msgs::TFMessage& message) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      early_.push_back(message);
    }
    if (!ros::Time::now().isZero()) write_early(ros::Time::now());
  }

  void write_early(ros::Time time) {
    std::vector<tf2_msgs::TFMessage> messages;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      messages.swap(early_);
    }
    for (const tf2_msgs::TFMessage& message : messages) write("/tf_static", time, message, nullptr);
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
    if (time.isZero()) return;
    if (topic != "/tf_static") write_early(time);
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!open_) return;
    try {
      bag_.write(topic, time, message, connection_header);
    } catch (const rosbag::BagException& error) {
      NODELET_FATAL("Recording stopped: %s: %s. What was written is kept.", config_.bag.c_str(),
                    error.what());
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
  std::vector<tf2_msgs::TFMessage> early_;  ///< static transforms from before the first stamp
  ros::Subscriber depth_subscriber_, static_tf_subscriber_;
  std::vector<ros::Subscriber> subscribers_;
};

}  // namespace knav

PLUGINLIB_EXPORT_CLASS(knav::MappingRecorderNodelet, nodelet::Nodelet)
