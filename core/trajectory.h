#pragma once

#include <string>
#include <vector>

#include "core/pose2.h"

namespace knav {

struct StampedPose2 {
  double stamp_s = 0.0;
  Pose2 T_map_robot;
};

/// Sorted by stamp.
using Trajectory = std::vector<StampedPose2>;

/// TUM text, `t x y z qx qy qz qw` a line, '#' comments. Also accepts `t x y theta`. UserError names file and line.
Trajectory read_trajectory(const std::string& path);

/// Atomic; z = 0 and a rotation about z only.
void write_trajectory(const std::string& path, const Trajectory& trajectory);

/// The pose at a stamp, interpolated; false outside the trajectory or in a gap longer than max_gap_s.
bool interpolate_at(const Trajectory& trajectory, double stamp_s, double max_gap_s, Pose2* T_map_robot);

}  // namespace knav
