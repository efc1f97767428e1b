#pragma once

#include <ros/time.h>
#include <tf2_ros/transform_broadcaster.h>

#include <string>

#include "core/pose2.h"
#include "tsdf_localizer/correction.h"

namespace knav {

/// Publishes map->odom whenever asked (by a timer), post-dated, never a stamp twice; led after the estimate if it is limited.
class MapOdomBroadcaster {
 public:
  MapOdomBroadcaster(std::string map_frame, std::string odom_frame, double tolerance_s, const SlewLimit& limit)
      : map_frame_(std::move(map_frame)), odom_frame_(std::move(odom_frame)), tolerance_(tolerance_s), limit_(limit) {}

  /// Both poses at the same stamp.
  void set(const Pose2& T_map_base, const Pose2& T_odom_base) {
    T_map_odom_ = T_map_base * T_odom_base.inverse();
    T_odom_base_ = T_odom_base;
    if (!known_) T_published_ = T_map_odom_;
    known_ = true;
  }
  void forget() {
    known_ = false;
    last_sent_ = ros::Time();
  }
  bool known() const { return known_; }
  const Pose2& T_map_odom() const { return T_map_odom_; }
  /// Stamped `now` plus the tolerance; nothing before the first pose, and nothing while the clock stands.
  void send(const ros::Time& now);

 private:
  std::string map_frame_, odom_frame_;
  ros::Duration tolerance_;
  tf2_ros::TransformBroadcaster broadcaster_;
  SlewLimit limit_;
  Pose2 T_map_odom_, T_odom_base_, T_published_;
  bool known_ = false;
  ros::Time last_sent_;
};

}  // namespace knav
