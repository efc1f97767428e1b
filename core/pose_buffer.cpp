#include "core/pose_buffer.h"

namespace knav {

bool PoseBuffer::add(double stamp_s, const Pose2& T_odom_robot) {
  if (size_ > 0 && stamp_s <= newest_s()) return false;
  if (size_ == stamp_s_.size()) {
    first_ = (first_ + 1) % stamp_s_.size();
  } else {
    ++size_;
  }
  stamp_s_[slot(size_ - 1)] = stamp_s;
  pose_[slot(size_ - 1)] = T_odom_robot;
  return true;
}

PoseBuffer::Lookup PoseBuffer::at(double stamp_s, double max_gap_s, double max_extrapolation_s,
                                  Pose2* T_odom_robot) const {
  if (size_ == 0) return Lookup::kEmpty;
  if (stamp_s < oldest_s()) return Lookup::kTooOld;
  if (stamp_s >= newest_s()) {
    const double ahead_s = stamp_s - newest_s();
    if (ahead_s > max_extrapolation_s) return Lookup::kTooNew;
    const Pose2& newest = pose_[slot(size_ - 1)];
    if (ahead_s <= 0.0 || size_ == 1) {
      *T_odom_robot = newest;
      return Lookup::kOk;
    }
    const double step_s = newest_s() - stamp_s_[slot(size_ - 2)];
    if (step_s > max_gap_s) return Lookup::kGap;
    const Pose2 T_step = pose_[slot(size_ - 2)].inverse() * newest;
    const double t = ahead_s / step_s;
    *T_odom_robot = newest * Pose2{t * T_step.x_m, t * T_step.y_m, t * T_step.yaw_rad};
    return Lookup::kOk;
  }
  std::size_t low = 0, high = size_ - 1;  // stamp[low] <= stamp_s < stamp[high]
  while (high - low > 1) {
    const std::size_t middle = (low + high) / 2;
    (stamp_s_[slot(middle)] <= stamp_s ? low : high) = middle;
  }
  const double before_s = stamp_s_[slot(low)], after_s = stamp_s_[slot(high)];
  if (after_s - before_s > max_gap_s) return Lookup::kGap;
  *T_odom_robot = interpolate(pose_[slot(low)], pose_[slot(high)], (stamp_s - before_s) / (after_s - before_s));
  return Lookup::kOk;
}

}  // namespace knav
