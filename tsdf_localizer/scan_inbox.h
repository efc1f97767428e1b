#pragma once

#include <kinect_nav/MotionEstimate.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_ros/buffer.h>

#include <deque>
#include <optional>
#include <string>

#include "core/pose2.h"
#include "tsdf_localizer/localizer_node_config.h"

namespace knav {

/// A scan with all that belongs to its stamp.
struct ScanInput {
  sensor_msgs::LaserScanConstPtr scan;
  Pose2 T_base_sensor;
  Pose2 T_local_base;
  std::uint32_t epoch = 0;  ///< of the motion; changes as well when its source does
  std::optional<Pose2> T_odom_base;
};

/// Holds scans until the motion estimate and the transforms of their stamp are there. Never blocks.
class ScanInbox {
 public:
  ScanInbox(const LocalizerNodeConfig& config, const tf2_ros::Buffer& tf) : config_(config), tf_(tf) {}

  void add(const sensor_msgs::LaserScanConstPtr& scan);
  void add(const kinect_nav::MotionEstimateConstPtr& motion);
  void clear();

  enum class Outcome { kNothing, kReady, kDropped };
  /// The oldest scan that has waited long enough or has all it needs. kDropped: `why` is a sentence to print.
  Outcome next(ScanInput* input, std::string* why);
  /// The epoch as the mapper counts it, for the status.
  std::uint32_t mapper_epoch() const { return mapper_epoch_; }

 private:
  bool uses_estimates() const;
  const kinect_nav::MotionEstimate* motion_at(const ros::Time& stamp) const;

  LocalizerNodeConfig config_;
  const tf2_ros::Buffer& tf_;
  std::deque<sensor_msgs::LaserScanConstPtr> scans_;
  std::deque<kinect_nav::MotionEstimateConstPtr> motions_;
  bool last_was_estimate_ = false, any_ = false;
  std::uint32_t mapper_epoch_ = 0, epoch_ = 0;
};

/// TF2 has no leading slashes; old drivers still send them.
std::string without_slash(const std::string& frame);

}  // namespace knav
