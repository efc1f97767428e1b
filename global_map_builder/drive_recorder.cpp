#include "global_map_builder/drive_recorder.h"

#include <Eigen/LU>
#include <cmath>

#include "global_map_builder/corrected_drive.h"

namespace knav {
namespace {

constexpr double kBreakScale = 10.0;  // how much less a step is trusted when the mapper lost the thread

bool moved(const Pose2& a, const Pose2& b, double distance, double angle_deg) {
  return distance_m(a, b) >= distance ||
         std::fabs(normalize_angle_rad(b.yaw_rad - a.yaw_rad)) >= angle_deg * kPi / 180.0;
}

/// Of the step from one keyframe to the next, in the axes of the latter.
Eigen::Matrix3d step_covariance(const DriveConfig& config, double path_m, double turn_rad, bool after_break) {
  const double scale = after_break ? kBreakScale : 1.0;
  const double root = std::sqrt(std::max(path_m, 1e-3));
  const double position = scale * (config.position_sd_floor_m + config.position_sd_per_m * root);
  const double heading = scale * (0.001 + config.heading_sd_deg_per_m * kPi / 180.0 * root +
                                  config.heading_sd_per_turn * std::fabs(turn_rad));
  return Eigen::Vector3d(position * position, position * position, heading * heading).asDiagonal();
}

}  // namespace

DriveRecorder::DriveRecorder(const DriveConfig& config, const LocalMapperConfig& mapper)
    : config_(config), mapper_(mapper) {}

template <class Observation>
void DriveRecorder::take(const Observation& observation, const Pose2& T_base_sensor) {
  const LocalMapperResult& result = mapper_.update(observation, T_base_sensor);
  if (!result.accepted) {
    ++refused_;
    last_refusal_ = result.reason;
    return;
  }
  if (trajectory_.empty()) {
    T_drive_local_ = result.T_local_base.inverse();
  } else if (result.epoch != epoch_) {
    const Pose2 T_drive_base =
        trajectory_.back().T_map_robot * (odometry_.back().T_map_robot.inverse() * result.T_odom_base);
    T_drive_local_ = T_drive_base * result.T_local_base.inverse();
    break_pending_ = true;
    ++breaks_;
    // The mapper notices late that it went astray: what it said just before is not to be trusted either.
    for (PoseGraphEdge& edge : edges_) {
      if (keyframes_[static_cast<std::size_t>(edge.to)].stamp_s >
          result.stamp_s - config_.doubt_before_break_s) {
        edge.information /= kBreakScale * kBreakScale;
      }
    }
  }
  epoch_ = result.epoch;
  const Pose2 T_drive_base = T_drive_local_ * result.T_local_base;
  if (!trajectory_.empty()) path_m_ += distance_m(trajectory_.back().T_map_robot, T_drive_base);
  trajectory_.push_back({result.stamp_s, T_drive_base});
  odometry_.push_back({result.stamp_s, result.T_odom_base});

  if (keyframes_.empty() || break_pending_ || mark_pending_ ||
      moved(keyframes_.back().T_drive_base, T_drive_base, config_.keyframe_distance_m,
            config_.keyframe_angle_deg)) {
    add_keyframe(result, T_drive_base);
  }
  const bool usable = result.outcome != FrameOutcome::kSuspicious;
  if (usable &&
      (frames_.empty() || result.stamp_s - frames_.back().stamp_s >= config_.frame_period_s ||
       moved(frames_.back().T_drive_base, T_drive_base, config_.frame_distance_m, config_.frame_angle_deg))) {
    frames_.push_back(
        {result.stamp_s, path_m_, T_drive_base, result.T_odom_base, T_base_sensor, observation});
  }
}

void DriveRecorder::add_keyframe(const LocalMapperResult& result, const Pose2& T_drive_base) {
  Keyframe keyframe{result.stamp_s, path_m_, T_drive_base, result.T_odom_base, break_pending_, mark_pending_};
  if (!keyframes_.empty()) {
    const Keyframe& before = keyframes_.back();
    PoseGraphEdge edge;
    edge.from = static_cast<int>(keyframes_.size()) - 1;
    edge.to = edge.from + 1;
    edge.T_from_to = before.T_drive_base.inverse() * T_drive_base;
    Eigen::Matrix3d covariance =
        step_covariance(config_, path_m_ - before.path_m, edge.T_from_to.yaw_rad, break_pending_);
    // The filter's spread shows which way it was unsure; it belongs to the whole window, so only a share
    // counts.
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    const double c = std::cos(result.T_local_base.yaw_rad), s = std::sin(result.T_local_base.yaw_rad);
    R.topLeftCorner<2, 2>() << c, s, -s, c;
    if (result.covariance.allFinite())
      covariance += config_.filter_share * R * result.covariance * R.transpose();
    edge.information = covariance.inverse();
    edge.information = 0.5 * (edge.information + edge.information.transpose().eval());
    edges_.push_back(edge);
  }
  keyframes_.push_back(keyframe);
  break_pending_ = mark_pending_ = false;
}

void DriveRecorder::adjust(const std::vector<Pose2>& T_drive_keyframe,
                           const std::vector<Eigen::Matrix3d>& added) {
  const CorrectedDrive corrected(keyframes_, T_drive_keyframe);
  for (DriveFrame& frame : frames_) frame.T_drive_base = corrected.at(frame.stamp_s, frame.T_drive_base);
  for (StampedPose2& pose : trajectory_) pose.T_map_robot = corrected.at(pose.stamp_s, pose.T_map_robot);
  for (std::size_t i = 0; i < keyframes_.size(); ++i) keyframes_[i].T_drive_base = T_drive_keyframe[i];
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    edges_[i].T_from_to = T_drive_keyframe[i].inverse() * T_drive_keyframe[i + 1];
    edges_[i].information = (edges_[i].information.inverse() + added[i]).inverse();
  }
}

template void DriveRecorder::take(const DepthProfile&, const Pose2&);
template void DriveRecorder::take(const RangeScan&, const Pose2&);

}  // namespace knav
