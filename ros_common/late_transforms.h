#pragma once

#include <ros/time.h>
#include <tf2_ros/buffer.h>

namespace knav {

/// Empties a transform buffer once more, a moment after the clock jumped back. tf2's listener empties it at the jump
/// itself, but a transform of the old time that was under way arrives after that, and by its later stamp keeps every
/// one of the new time out (TF_OLD_DATA) until the clock has come as far again. Static transforms stay.
class LateTransforms {
 public:
  explicit LateTransforms(tf2_ros::Buffer& buffer) : buffer_(buffer) {}

  void clock_jumped_back() { due_ = ros::WallTime::now() + ros::WallDuration(kUnderWay_s); }
  /// To be called regularly. True when the buffer was emptied just now: the old time is over.
  bool step() {
    if (due_.isZero() || ros::WallTime::now() < due_) return false;
    due_ = ros::WallTime();
    buffer_.clear();
    return true;
  }

 private:
  static constexpr double kUnderWay_s = 0.5;  ///< wall time after which nothing of the old time is under way any more

  tf2_ros::Buffer& buffer_;
  ros::WallTime due_;
};

}  // namespace knav
