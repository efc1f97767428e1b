#include "tsdf_local_mapper/odometry_stream.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace knav {
namespace {

constexpr double kShortestStep_s = 0.02;  // stamps jitter
constexpr double kJitter_m = 0.05;

}  // namespace

void OdometryStream::add(double stamp_s, const Pose2& T_odom_base) {
  if (!std::isfinite(stamp_s) || !is_finite(T_odom_base)) return;
  if (!poses_.empty()) {
    const double newest_s = poses_.newest_s();
    if (stamp_s <= newest_s) {
      if (newest_s - stamp_s <= config_.clock_jump_s) return;
      poses_.clear();  // the clock jumped back; the next frame will find so too
    } else {
      Pose2 newest;
      poses_.at(newest_s, 1e9, 0.0, &newest);
      const double dt_s = stamp_s - newest_s;
      if (dt_s > config_.odometry_gap_s) {
        break_ = Break::kGap;
        poses_.clear();
      } else if (distance_m(newest, T_odom_base) >
                 config_.odometry_max_speed_mps * std::max(dt_s, kShortestStep_s) + kJitter_m) {
        break_ = Break::kJump;
        poses_.clear();
      }
    }
  }
  poses_.add(stamp_s, T_odom_base);
}

PoseBuffer::Lookup OdometryStream::at(double stamp_s, Pose2* T_odom_base) const {
  return poses_.at(stamp_s, config_.odometry_gap_s, config_.odometry_extrapolation_s, T_odom_base);
}

OdometryStream::Break OdometryStream::take_break() { return std::exchange(break_, Break::kNone); }

void OdometryStream::clock_jumped_back_to(double stamp_s) {
  if (!poses_.empty() && poses_.oldest_s() > stamp_s + config_.clock_jump_s) poses_.clear();
}

void OdometryStream::clear() {
  poses_.clear();
  break_ = Break::kNone;
}

}  // namespace knav
