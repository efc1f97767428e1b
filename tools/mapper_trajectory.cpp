#include "tools/mapper_trajectory.h"

namespace knav {

void MapperTrajectory::add(const LocalMapperResult& result) {
  ++frames_;
  if (!result.accepted) return;
  if (odometry_.empty()) {
    epoch_ = result.epoch;
    T_map_local_ = result.T_local_base.inverse();
  } else if (result.epoch != epoch_) {
    epoch_ = result.epoch;
    ++epochs_;
    const Pose2 T_map_base =
        estimate_.back().T_map_robot * (odometry_.back().T_map_robot.inverse() * result.T_odom_base);
    T_map_local_ = T_map_base * result.T_local_base.inverse();
  }
  const Pose2 T_map_base = T_map_local_ * result.T_local_base;
  if (!estimate_.empty()) path_m_ += distance_m(estimate_.back().T_map_robot, T_map_base);
  estimate_.push_back({result.stamp_s, T_map_base});
  odometry_.push_back({result.stamp_s, result.T_odom_base});
}

}  // namespace knav
