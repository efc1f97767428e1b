#include "global_map_builder/drive_recorder.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <type_traits>

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

/// Maps come out better so, in three drives (docs/mapping.md has the figures; both parameters' descriptions say it).
LocalMapperConfig for_mapping(LocalMapperConfig mapper, const DriveConfig& config, bool scan) {
  mapper.range_errors.learn = false;
  mapper.filter.thin_rows = 0;
  mapper.tsdf.threads = std::max(mapper.tsdf.threads, config.mapper_threads);
  mapper.filter.threads = std::max(mapper.filter.threads, config.mapper_threads);
  if (scan) mapper.odometry_timing.stamp_sd_s = std::max(mapper.odometry_timing.stamp_sd_s, config.scan_stamp_sd_s);
  return mapper;
}

}  // namespace

DriveRecorder::DriveRecorder(const DriveConfig& config, const LocalMapperConfig& mapper)
    : config_(config), mapper_config_(mapper) {}

void DriveRecorder::add_odometry(double stamp_s, const Pose2& T_odom_base) {
  if (mapper_) {
    mapper_->add_odometry(stamp_s, T_odom_base);
  } else {
    early_odometry_.push_back({stamp_s, T_odom_base});
  }
}

template <class Observation>
void DriveRecorder::take(const Observation& observation, const Pose2& T_base_sensor) {
  constexpr bool kScan = std::is_same_v<Observation, RangeScan>;
  if (!mapper_) {
    mapper_.emplace(for_mapping(mapper_config_, config_, kScan));
    for (const StampedPose2& pose : early_odometry_) mapper_->add_odometry(pose.stamp_s, pose.T_map_robot);
    early_odometry_ = {};
  }
  const LocalMapperResult& result = mapper_->update(observation, T_base_sensor);
  if (!result.accepted) {
    ++refused_;
    last_refusal_ = result.reason;
    return;
  }
  if (drive_.trajectory.empty()) {
    T_drive_local_ = result.T_local_base.inverse();
  } else if (result.epoch != epoch_) {
    const Pose2 T_drive_base = drive_.trajectory.back().T_map_robot *
                               (drive_.odometry.back().T_map_robot.inverse() * result.T_odom_base);
    T_drive_local_ = T_drive_base * result.T_local_base.inverse();
    break_pending_ = true;
    ++drive_.breaks;
    // The mapper notices late that it went astray: what it said just before is not to be trusted either.
    for (PoseGraphEdge& edge : drive_.edges) {
      if (drive_.keyframes[static_cast<std::size_t>(edge.to)].stamp_s >
          result.stamp_s - config_.doubt_before_break_s) {
        edge.information /= kBreakScale * kBreakScale;
      }
    }
  }
  epoch_ = result.epoch;
  const Pose2 T_drive_base = T_drive_local_ * result.T_local_base;
  if (!drive_.trajectory.empty()) path_m_ += distance_m(drive_.trajectory.back().T_map_robot, T_drive_base);
  drive_.trajectory.push_back({result.stamp_s, T_drive_base});
  drive_.odometry.push_back({result.stamp_s, result.T_odom_base});

  if (drive_.keyframes.empty() || break_pending_ || mark_pending_ ||
      moved(drive_.keyframes.back().T_drive_base, T_drive_base,
            kScan ? config_.scan_keyframe_distance_m : config_.keyframe_distance_m,
            kScan ? config_.scan_keyframe_angle_deg : config_.keyframe_angle_deg)) {
    add_keyframe(result, T_drive_base);
  }
  const bool usable = result.outcome != FrameOutcome::kSuspicious;
  if (usable &&
      (drive_.frames.empty() || result.stamp_s - drive_.frames.back().stamp_s >= config_.frame_period_s ||
       moved(drive_.frames.back().T_drive_base, T_drive_base, config_.frame_distance_m,
             config_.frame_angle_deg))) {
    drive_.frames.push_back(
        {result.stamp_s, path_m_, T_drive_base, result.T_odom_base, T_base_sensor, observation});
  }
}

void DriveRecorder::add_keyframe(const LocalMapperResult& result, const Pose2& T_drive_base) {
  Keyframe keyframe{result.stamp_s, path_m_, T_drive_base, result.T_odom_base, break_pending_, mark_pending_};
  if (!drive_.keyframes.empty()) {
    const Keyframe& before = drive_.keyframes.back();
    PoseGraphEdge edge;
    edge.from = static_cast<int>(drive_.keyframes.size()) - 1;
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
    drive_.edges.push_back(edge);
  }
  drive_.keyframes.push_back(keyframe);
  break_pending_ = mark_pending_ = false;
}

template void DriveRecorder::take(const DepthProfile&, const Pose2&);
template void DriveRecorder::take(const RangeScan&, const Pose2&);

}  // namespace knav
