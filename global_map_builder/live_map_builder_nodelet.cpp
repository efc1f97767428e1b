// Builds a map while the robot is driven: the local mapper runs along, `growing_map` shows what there is, and
// at the end (service finish_mapping, or when the node ends) the loops are closed and the directory is
// written.
#include <kinect_nav/DepthProfile.h>
#include <nav_msgs/OccupancyGrid.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/Joy.h>
#include <sensor_msgs/LaserScan.h>
#include <std_msgs/Empty.h>
#include <std_msgs/UInt32.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <deque>
#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <string>

#include "core/error.h"
#include "global_map_builder/build_map_config.h"
#include "global_map_builder/growing_map.h"
#include "global_map_builder/live_map_builder_config.h"
#include "global_map_builder/map_writer.h"
#include "ros_common/conversions.h"
#include "ros_common/nodelet_base.h"
#include "ros_common/parameters.h"

namespace knav {

class LiveMapBuilderNodelet : public NodeletBase {
 public:
  ~LiveMapBuilderNodelet() override {
    if (!builder_ || finished_ || !config_.build_at_end || builder_->drive().frames.empty()) return;
    std::string message;
    finish(&message);
  }

 private:
  struct Pending {
    double stamp_s = 0.0;
    kinect_nav::DepthProfileConstPtr profile;
    sensor_msgs::LaserScanConstPtr scan;
  };

  void start() override {
    ros::NodeHandle& node = getNodeHandle();  // one thread: callbacks never overlap
    config_ = read_parameters<LiveMapBuilderConfig>(getPrivateNodeHandle());
    const auto map = read_parameters<BuildMapConfig>(ros::NodeHandle(node, "map_builder"));
    builder_ = std::make_unique<MapBuilder>(
        map, read_parameters<LocalMapperConfig>(ros::NodeHandle(node, "local_mapper")));
    builder_->begin_drive("live");
    growing_ = std::make_unique<GrowingMap>(map.surface, config_.map_resolution_m);
    mark_button_ = static_cast<std::size_t>(map.recording.mark_button);
    base_frame_ = map.recording.base_frame;
    listener_ = std::make_unique<tf2_ros::TransformListener>(tf_, node);
    map_publisher_ = node.advertise<nav_msgs::OccupancyGrid>("growing_map", 1, true);
    marks_publisher_ = node.advertise<std_msgs::UInt32>("marks_counted", 1, true);
    finish_ = node.advertiseService("finish_mapping", &LiveMapBuilderNodelet::on_finish, this);
    subscribers_ = {node.subscribe("odom", 500, &LiveMapBuilderNodelet::on_odometry, this,
                                   ros::TransportHints().tcpNoDelay()),
                    node.subscribe("depth_profile", 60, &LiveMapBuilderNodelet::on_profile, this),
                    node.subscribe("scan_in", 60, &LiveMapBuilderNodelet::on_scan, this),
                    node.subscribe("mark_place", 10, &LiveMapBuilderNodelet::on_mark, this),
                    node.subscribe("joy", 50, &LiveMapBuilderNodelet::on_joy, this)};
    timer_ =
        node.createWallTimer(ros::WallDuration(config_.map_period_s), &LiveMapBuilderNodelet::on_timer, this);
    publish_marks();
    NODELET_INFO("Mapping into %s; call %s when the drive is over.", config_.directory.c_str(),
                 finish_.getService().c_str());
  }

  void on_odometry(const nav_msgs::OdometryConstPtr& message) {
    if (finished_ || message->header.stamp.isZero()) return;
    odometry_s_ = message->header.stamp.toSec();
    builder_->add_odometry(odometry_s_, pose2_from(message->pose.pose));
    process_pending();
  }
  void on_profile(const kinect_nav::DepthProfileConstPtr& message) {
    enqueue({message->header.stamp.toSec(), message, nullptr});
  }
  void on_scan(const sensor_msgs::LaserScanConstPtr& message) {
    enqueue({message->header.stamp.toSec(), nullptr, message});
  }
  void on_mark(const std_msgs::EmptyConstPtr&) { mark(); }
  void on_joy(const sensor_msgs::JoyConstPtr& message) {
    const bool pressed = mark_button_ < message->buttons.size() && message->buttons[mark_button_] != 0;
    if (pressed && !joy_pressed_) mark();
    joy_pressed_ = pressed;
  }

  void mark() {
    if (finished_) return;
    builder_->mark(odometry_s_);
    ++marks_;
    publish_marks();
    NODELET_INFO("Place marked: button press %u.", marks_);
  }
  void publish_marks() {
    std_msgs::UInt32 message;
    message.data = marks_;
    marks_publisher_.publish(message);
  }

  void enqueue(Pending frame) {
    if (finished_) return;
    pending_.push_back(std::move(frame));
    process_pending();
    while (static_cast<int>(pending_.size()) > config_.frames_waiting) {
      pending_.pop_front();
      NODELET_WARN_THROTTLE(10.0,
                            "Frames are dropped: odometry on '%s' does not keep up with them, or is missing.",
                            subscribers_.front().getTopic().c_str());
    }
  }

  /// A frame waits until odometry covers its stamp.
  void process_pending() {
    while (!pending_.empty() && pending_.front().stamp_s <= odometry_s_) {
      const Pending frame = pending_.front();
      pending_.pop_front();
      const std::string& sensor =
          frame.profile ? frame.profile->header.frame_id : frame.scan->header.frame_id;
      try {
        const geometry_msgs::Transform T = tf_.lookupTransform(base_frame_, sensor, ros::Time(0)).transform;
        if (frame.profile) {
          profile_from(*frame.profile, &profile_);
          builder_->add(profile_, planar_camera_pose(T));
        } else {
          scan_from(*frame.scan, &scan_);
          builder_->add(scan_, pose2_from(T));
        }
      } catch (const tf2::TransformException& error) {
        NODELET_WARN_THROTTLE(10.0, "No transform from '%s' to '%s' yet, frames are not used: %s",
                              sensor.c_str(), base_frame_.c_str(), error.what());
      } catch (const UserError& error) {
        NODELET_WARN_THROTTLE(10.0, "%s", error.what());
      }
    }
  }

  void on_timer(const ros::WallTimerEvent&) {
    if (finished_ || map_publisher_.getNumSubscribers() == 0 || builder_->drive().frames.empty()) return;
    const Drive& drive = builder_->drive();
    growing_->update(drive);
    const OccupancyGrid grid = growing_->grid();
    nav_msgs::OccupancyGrid message;
    occupancy_message(grid, &message);
    // The grid lies in the drive's frame; odometry sees that turned and moved.
    const Pose2 T_odom_drive = drive.frames.back().T_odom_base * drive.frames.back().T_drive_base.inverse();
    message.info.origin =
        pose_message(T_odom_drive * Pose2{grid.geometry.origin_x_m, grid.geometry.origin_y_m, 0.0});
    message.header.frame_id = config_.odom_frame;
    message.header.stamp.fromSec(drive.frames.back().stamp_s);
    map_publisher_.publish(message);
  }

  bool on_finish(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    response.success = finish(&response.message);
    return true;
  }

  bool finish(std::string* message) {
    if (finished_) {
      *message = "The map is already built.";
      return false;
    }
    try {
      if (builder_->drive().frames.empty()) throw UserError("nothing was seen yet; nothing was built.");
      finished_ = true;
      NODELET_INFO("Closing loops and building %s.", config_.directory.c_str());
      BuiltMap built = builder_->build();
      nlohmann::json figures = figures_of(built);
      figures["marks"] = marks_;
      built.map.about["made_by"] = "live_map_builder";
      write_built_map(config_.directory, figures, false, &built);
      *message = config_.directory + ": written, " + figures["closures"]["accepted"].dump() +
                 " closures, checksum " + built.map.checksum;
      NODELET_INFO("%s", message->c_str());
      return true;
    } catch (const std::exception& error) {
      *message = error.what();
      NODELET_ERROR("No map: %s", error.what());
      return false;
    }
  }

  LiveMapBuilderConfig config_;
  std::unique_ptr<MapBuilder> builder_;
  std::unique_ptr<GrowingMap> growing_;
  tf2_ros::Buffer tf_;
  std::unique_ptr<tf2_ros::TransformListener> listener_;
  ros::Publisher map_publisher_, marks_publisher_;
  ros::ServiceServer finish_;
  std::vector<ros::Subscriber> subscribers_;
  ros::WallTimer timer_;
  std::deque<Pending> pending_;
  DepthProfile profile_;
  RangeScan scan_;
  std::string base_frame_;
  std::size_t mark_button_ = 0;
  double odometry_s_ = -1e300;
  std::uint32_t marks_ = 0;
  bool joy_pressed_ = false, finished_ = false;
};

}  // namespace knav

PLUGINLIB_EXPORT_CLASS(knav::LiveMapBuilderNodelet, nodelet::Nodelet)
