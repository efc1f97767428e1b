#include "tsdf_localizer/scan_inbox.h"

#include <fmt/format.h>

#include "ros_common/conversions.h"

namespace knav {
namespace {

constexpr std::size_t kScansMax = 30, kMotionsMax = 100;

}  // namespace

std::string without_slash(const std::string& frame) {
  return !frame.empty() && frame[0] == '/' ? frame.substr(1) : frame;
}

void ScanInbox::add(const sensor_msgs::LaserScanConstPtr& scan) {
  scans_.push_back(scan);
  if (scans_.size() > kScansMax) scans_.pop_front();
}

void ScanInbox::add(const kinect_nav::MotionEstimateConstPtr& motion) {
  motions_.push_back(motion);
  if (motions_.size() > kMotionsMax) motions_.pop_front();
}

void ScanInbox::clear() {
  scans_.clear();
  motions_.clear();
  any_ = false;
}

bool ScanInbox::uses_estimates() const {
  if (config_.motion_source != "auto") return config_.motion_source == "motion_estimate";
  return !motions_.empty();
}

const kinect_nav::MotionEstimate* ScanInbox::motion_at(const ros::Time& stamp) const {
  for (auto it = motions_.rbegin(); it != motions_.rend(); ++it) {
    if ((*it)->header.stamp == stamp) return it->get();
  }
  return nullptr;
}

ScanInbox::Outcome ScanInbox::next(ScanInput* input, std::string* why) {
  if (scans_.empty()) return Outcome::kNothing;
  const sensor_msgs::LaserScanConstPtr scan = scans_.front();
  const ros::Time stamp = scan->header.stamp;
  const double waited_s = (scans_.back()->header.stamp - stamp).toSec();
  const bool patient = waited_s < config_.wait_for_transform_s && scans_.size() < kScansMax;
  const auto drop = [&](const std::string& reason) {
    scans_.pop_front();
    *why = reason;
    return Outcome::kDropped;
  };
  const std::string frame = without_slash(scan->header.frame_id);
  if (frame.empty()) return drop("scan dropped: its header has no frame_id; set it in the scan's publisher.");

  input->scan = scan;
  input->T_odom_base.reset();
  std::string trouble;
  try {
    const auto T = tf_.lookupTransform(config_.odom_frame_id, config_.base_frame_id, stamp);
    const Pose2 pose = pose2_from(T.transform);
    if (is_finite(pose)) input->T_odom_base = pose;
  } catch (const tf2::TransformException& error) {
    trouble = error.what();
  }
  input->T_base_sensor = Pose2();
  if (frame != config_.base_frame_id) {
    try {
      input->T_base_sensor = pose2_from(tf_.lookupTransform(config_.base_frame_id, frame, stamp).transform);
    } catch (const tf2::TransformException& error) {
      if (patient) return Outcome::kNothing;
      return drop(fmt::format(
          "scan dropped: no transform from its frame '{}' to '{}' ({}); publish it or correct the frames.",
          frame, config_.base_frame_id, error.what()));
    }
  }
  const kinect_nav::MotionEstimate* motion = uses_estimates() ? motion_at(stamp) : nullptr;
  if (uses_estimates() && motion == nullptr) {
    const bool passed = !motions_.empty() && motions_.back()->header.stamp > stamp;
    if (patient && !passed) return Outcome::kNothing;
    if (passed) return drop("scan dropped: no motion_estimate has its stamp, though newer ones have come.");
    if (config_.motion_source == "motion_estimate") {
      return drop("scan dropped: no motion_estimate has its stamp; is the local mapper running?");
    }
  }
  if (!input->T_odom_base) {
    if (patient) return Outcome::kNothing;
    if (motion == nullptr) {
      return drop(fmt::format(
          "scan dropped: no transform from '{}' to '{}' at its stamp ({}); is the base driver running?",
          config_.odom_frame_id, config_.base_frame_id, trouble));
    }
  }
  scans_.pop_front();
  const bool changed_source = any_ && last_was_estimate_ != (motion != nullptr);
  const bool changed_epoch =
      any_ && motion != nullptr && last_was_estimate_ && motion->epoch != mapper_epoch_;
  epoch_ += changed_source || changed_epoch;
  any_ = true;
  last_was_estimate_ = motion != nullptr;
  if (motion != nullptr) mapper_epoch_ = motion->epoch;
  input->T_local_base = motion != nullptr ? pose2_from(motion->pose.pose) : *input->T_odom_base;
  input->epoch = epoch_;
  return Outcome::kReady;
}

}  // namespace knav
