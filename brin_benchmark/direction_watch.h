#pragma once

#include <cmath>

#include "core/pose2.h"

namespace knav {

/// Counts how often a robot changes its mind on one goal: it turns round on its way, or sways on the spot.
class DirectionWatch {
 public:
  static constexpr double kStep_m = 0.25;       ///< of travel, whose direction is compared with the step before
  static constexpr double kTurnedRound_rad = 2.1;
  static constexpr double kSway_rad = 0.8;      ///< turned back by this much within a step: a sway

  void start(const Pose2& T_world_robot) {
    *this = {};
    anchor_ = T_world_robot;
    yaw_rad_ = low_rad_ = high_rad_ = 0.0;
    last_yaw_rad_ = T_world_robot.yaw_rad;
  }

  void add(const Pose2& T_world_robot) {
    yaw_rad_ += normalize_angle_rad(T_world_robot.yaw_rad - last_yaw_rad_);
    last_yaw_rad_ = T_world_robot.yaw_rad;
    // A turn of any size is one decision; back from its end by more than a sway is another.
    if (swing_ >= 0 && yaw_rad_ < high_rad_ - kSway_rad) {
      if (swing_ > 0) ++sways_;
      swing_ = -1;
      low_rad_ = yaw_rad_;
    } else if (swing_ <= 0 && yaw_rad_ > low_rad_ + kSway_rad) {
      if (swing_ < 0) ++sways_;
      swing_ = 1;
      high_rad_ = yaw_rad_;
    }
    low_rad_ = std::fmin(low_rad_, yaw_rad_);
    high_rad_ = std::fmax(high_rad_, yaw_rad_);

    if (distance_m(anchor_, T_world_robot) < kStep_m) return;
    const double heading = std::atan2(T_world_robot.y_m - anchor_.y_m, T_world_robot.x_m - anchor_.x_m);
    if (travelled_ && std::fabs(normalize_angle_rad(heading - heading_rad_)) > kTurnedRound_rad) ++turned_round_;
    travelled_ = true;
    heading_rad_ = heading;
    anchor_ = T_world_robot;
    swing_ = 0;  // on the way, turns are the path's
    low_rad_ = high_rad_ = yaw_rad_;
  }

  int turned_round() const { return turned_round_; }
  int sways() const { return sways_; }
  int reversals() const { return turned_round_ + sways_; }

 private:
  Pose2 anchor_;
  bool travelled_ = false;
  double heading_rad_ = 0.0, yaw_rad_ = 0.0, last_yaw_rad_ = 0.0, low_rad_ = 0.0, high_rad_ = 0.0;
  int swing_ = 0, turned_round_ = 0, sways_ = 0;
};

}  // namespace knav
