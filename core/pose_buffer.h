#pragma once

#include <cstddef>
#include <vector>

#include "core/pose2.h"

namespace knav {

/// The last few seconds of odometry, to be asked for the pose at a stamp. A ring: no allocation once full.
class PoseBuffer {
 public:
  explicit PoseBuffer(std::size_t capacity = 2048) : stamp_s_(capacity), pose_(capacity) {}

  /// Stamps must rise; an older or equal one is ignored (returns false).
  bool add(double stamp_s, const Pose2& T_odom_robot);
  void clear() { size_ = 0; }
  bool empty() const { return size_ == 0; }
  double oldest_s() const { return stamp_s_[slot(0)]; }
  double newest_s() const { return stamp_s_[slot(size_ - 1)]; }

  enum class Lookup { kOk, kTooOld, kTooNew, kGap, kEmpty };
  /// Interpolated between the two neighbours; up to max_extrapolation_s past the newest by its last velocity.
  Lookup at(double stamp_s, double max_gap_s, double max_extrapolation_s, Pose2* T_odom_robot) const;

 private:
  std::size_t slot(std::size_t i) const { return (first_ + i) % stamp_s_.size(); }
  std::vector<double> stamp_s_;
  std::vector<Pose2> pose_;
  std::size_t first_ = 0, size_ = 0;
};

}  // namespace knav
