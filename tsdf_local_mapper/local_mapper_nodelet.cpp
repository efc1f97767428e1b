// The local mapper in the graph: depth_profile (or any LaserScan on scan_in), odom and TF in; see
// local_mapper_publisher.h for what goes out.
#include <diagnostic_updater/diagnostic_updater.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <kinect_nav/DepthProfile.h>
#include <kinect_nav/LocalizationStatus.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <deque>
#include <filesystem>
#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <string>

#include "core/error.h"
#include "ros_common/conversions.h"
#include "ros_common/nodelet_base.h"
#include "ros_common/parameters.h"
#include "tsdf_local_mapper/local_mapper.h"
#include "tsdf_local_mapper/local_mapper_publisher.h"

namespace knav {

class LocalMapperNodelet : public NodeletBase {
 public:
  ~LocalMapperNodelet() override { keep_range_offsets(); }

 private:
  struct Pending {
    kinect_nav::DepthProfileConstPtr profile;
    sensor_msgs::LaserScanConstPtr scan;
  };
  using Clock = std::chrono::steady_clock;
  static constexpr int kKeepEvery_s = 60;

  void start() override {
    ros::NodeHandle& node = getNodeHandle();  // one thread: callbacks never overlap
    config_ = read_parameters<LocalMapperConfig>(getPrivateNodeHandle());
    mapper_ = std::make_unique<LocalMapper>(config_);
    offsets_file_ = config_.ros.range_errors_file;
    if (!offsets_file_.empty() && std::filesystem::exists(offsets_file_)) {
      try {
        mapper_->start_from(RangeOffsets::load(offsets_file_));
      } catch (const UserError& error) {
        NODELET_ERROR("%s Until then nothing is kept in it.", error.what());
        offsets_file_.clear();
      }
    }
    publisher_ = std::make_unique<LocalMapperPublisher>(node, config_.ros);
    listener_ = std::make_unique<tf2_ros::TransformListener>(tf_, node);
    diagnostics_ = std::make_unique<diagnostic_updater::Updater>(node, getPrivateNodeHandle(), getName());
    diagnostics_->setHardwareID("none");
    diagnostics_->add("local mapper", this, &LocalMapperNodelet::diagnose);
    last_frame_wall_ = ros::WallTime::now();
    // Without TCP_NODELAY small odometry messages may be held back for 40 ms.
    odom_ = node.subscribe("odom", 200, &LocalMapperNodelet::on_odometry, this,
                           ros::TransportHints().tcpNoDelay());
    profile_ = node.subscribe("depth_profile", 5, &LocalMapperNodelet::on_profile, this);
    scan_ = node.subscribe("scan_in", 5, &LocalMapperNodelet::on_scan, this);
    initial_pose_ = node.subscribe("initialpose", 2, &LocalMapperNodelet::on_initial_pose, this);
    localization_ = node.subscribe("localization_status", 2, &LocalMapperNodelet::on_localization, this);
    timer_ = node.createWallTimer(ros::WallDuration(1.0), &LocalMapperNodelet::on_timer, this);
  }

  void on_timer(const ros::WallTimerEvent&) {
    diagnostics_->force_update();
    if (++seconds_ % kKeepEvery_s == 0) keep_range_offsets();
  }

  void keep_range_offsets() {
    if (!mapper_ || offsets_file_.empty() || !config_.range_errors.learn) return;
    try {
      mapper_->range_offsets().save(offsets_file_);
    } catch (const UserError& error) {
      NODELET_ERROR_THROTTLE(600.0, "What was learned of the depth camera is not kept: %s", error.what());
    }
  }

  void on_odometry(const nav_msgs::OdometryConstPtr& message) {
    mapper_->add_odometry(message->header.stamp.toSec(), pose2_from(message->pose.pose));
    process_pending();
  }

  void on_profile(const kinect_nav::DepthProfileConstPtr& message) { enqueue({message, nullptr}); }
  void on_scan(const sensor_msgs::LaserScanConstPtr& message) { enqueue({nullptr, message}); }

  /// Somebody says where the robot is: it may have been carried there, and the local map would be another place's.
  void on_initial_pose(const geometry_msgs::PoseWithCovarianceStampedConstPtr&) {
    pending_.clear();
    mapper_->reset();
    NODELET_INFO("A pose was given on %s: the local map begins anew.", initial_pose_.getTopic().c_str());
  }

  void on_localization(const kinect_nav::LocalizationStatusConstPtr& message) {
    mapper_->set_in_doubt(message->status != kinect_nav::LocalizationStatus::OK);
  }

  void enqueue(Pending frame) {
    pending_.push_back(std::move(frame));
    process_pending();
    while (static_cast<int>(pending_.size()) > config_.ros.frames_waiting) {
      pending_.pop_front();
      ++dropped_;
      NODELET_WARN_THROTTLE(10.0,
                            "Frames are dropped: odometry on '%s' does not keep up with them, or is missing.",
                            odom_.getTopic().c_str());
    }
  }

  /// A frame waits here until odometry covers its stamp.
  void process_pending() {
    while (!pending_.empty()) {
      const Pending& frame = pending_.front();
      if (frame.profile ? !process_profile(*frame.profile) : !process_scan(*frame.scan)) return;
      pending_.pop_front();
    }
  }

  bool process_profile(const kinect_nav::DepthProfile& message) {
    geometry_msgs::Transform T;
    if (!sensor_transform(message.header.frame_id, &T)) return true;
    try {
      profile_from(message, &profile_buffer_);
    } catch (const UserError& error) {
      NODELET_WARN_THROTTLE(10.0, "%s: %s", profile_.getTopic().c_str(), error.what());
      return true;
    }
    const auto begin = Clock::now();
    return finish(mapper_->update(profile_buffer_, planar_camera_pose(T)), begin);
  }

  bool process_scan(const sensor_msgs::LaserScan& message) {
    geometry_msgs::Transform T;
    if (!sensor_transform(message.header.frame_id, &T)) return true;
    scan_from(message, &scan_buffer_);
    const auto begin = Clock::now();
    return finish(mapper_->update(scan_buffer_, pose2_from(T)), begin);
  }

  bool sensor_transform(const std::string& frame, geometry_msgs::Transform* T) {
    try {
      *T = tf_.lookupTransform(config_.ros.base_frame, frame, ros::Time(0)).transform;
      transform_fault_.clear();
      return true;
    } catch (const tf2::TransformException& error) {
      transform_fault_ = error.what();
      ++no_transform_;
      NODELET_WARN_THROTTLE(10.0, "No transform from '%s' to '%s' yet, frames are not used: %s",
                            frame.c_str(), config_.ros.base_frame.c_str(), error.what());
      return false;
    }
  }

  /// @return false if the frame has to wait
  bool finish(const LocalMapperResult& result, Clock::time_point begin) {
    last_outcome_ = result.outcome;
    if (!result.accepted) {
      if (result.outcome == FrameOutcome::kWaitForOdometry) return false;
      ++refused_;
      NODELET_DEBUG("Frame not used: %s", result.reason.c_str());
      return true;
    }
    if (!result.reason.empty()) NODELET_WARN("Epoch %u: %s.", result.epoch, result.reason.c_str());
    const auto updated = Clock::now();
    publisher_->publish(*mapper_);
    const auto published = Clock::now();
    const auto ms = [](Clock::duration d) { return std::chrono::duration<double, std::milli>(d).count(); };
    ++frames_;
    update_ms_ += ms(updated - begin);
    publish_ms_ += ms(published - updated);
    longest_ms_ = std::max(longest_ms_, ms(published - begin));
    last_frame_wall_ = ros::WallTime::now();
    return true;
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
    using diagnostic_msgs::DiagnosticStatus;
    const LocalMapperResult& result = mapper_->result();
    const double silent_s = (ros::WallTime::now() - last_frame_wall_).toSec();
    if (!transform_fault_.empty()) {
      status.summary(DiagnosticStatus::ERROR, "no transform to the sensor");
    } else if (last_outcome_ == FrameOutcome::kWaitForOdometry && silent_s > 1.0) {
      status.summary(DiagnosticStatus::ERROR, "frames come, but no odometry for their stamps");
    } else if (silent_s > 2.0) {
      status.summary(DiagnosticStatus::WARN, "no frames");
    } else if (result.outcome == FrameOutcome::kSuspicious) {
      status.summary(DiagnosticStatus::WARN, "the view does not fit the map");
    } else if (result.outcome == FrameOutcome::kNoReadings) {
      status.summary(DiagnosticStatus::WARN, "nothing in view; the pose follows odometry");
    } else {
      status.summary(DiagnosticStatus::OK, to_string(result.outcome));
    }
    const double frames = std::max(1, frames_);
    status.add("epoch", result.epoch);
    status.add("epoch reason", to_string(result.epoch_reason));
    status.add("frames since last report", frames_);
    status.add("frames refused", refused_);
    status.add("frames dropped for want of odometry", dropped_);
    status.add("frames without transform", no_transform_);
    status.add("update mean ms", update_ms_ / frames);
    status.add("publish mean ms", publish_ms_ / frames);
    status.add("longest ms", longest_ms_);
    status.add("alignment cost", result.cost);
    status.add("effective particles", result.effective_particles);
    status.add("particle lifespan s", result.particle_lifespan_s);
    status.add("readings that agree with the map", result.agree_fraction);
    status.add("readings behind the map's surfaces", result.see_through_fraction);
    status.add("observations in the map", result.observations);
    const std::vector<double> offsets = mapper_->range_offsets().offset_per_m;
    const auto [least, most] = std::minmax_element(offsets.begin(), offsets.end());
    status.add("depth errors learned at 10 m %", 1000.0 * std::max(-*least, *most));
    status.add("cells reset by contradiction", mapper_->grid().cells_reset_by_contradiction());
    frames_ = 0;
    update_ms_ = publish_ms_ = longest_ms_ = 0.0;
  }

  LocalMapperConfig config_;
  std::unique_ptr<LocalMapper> mapper_;
  std::unique_ptr<LocalMapperPublisher> publisher_;
  tf2_ros::Buffer tf_;
  std::unique_ptr<tf2_ros::TransformListener> listener_;
  std::unique_ptr<diagnostic_updater::Updater> diagnostics_;
  ros::Subscriber odom_, profile_, scan_, initial_pose_, localization_;
  ros::WallTimer timer_;
  std::deque<Pending> pending_;
  DepthProfile profile_buffer_;
  RangeScan scan_buffer_;
  std::string transform_fault_, offsets_file_;
  FrameOutcome last_outcome_ = FrameOutcome::kBadFrame;
  int seconds_ = 0, frames_ = 0, refused_ = 0, dropped_ = 0, no_transform_ = 0;
  double update_ms_ = 0.0, publish_ms_ = 0.0, longest_ms_ = 0.0;
  ros::WallTime last_frame_wall_;
};

}  // namespace knav

PLUGINLIB_EXPORT_CLASS(knav::LocalMapperNodelet, nodelet::Nodelet)
