#pragma once

#include <cmath>
#include <vector>

#include "core/random.h"
#include "core/range_scan.h"
#include "flat_world.h"

namespace knav::flat_world {

/// 361 rays over 180 degrees, 0.1 to 30 m, noise of 8 mm.
inline RangeScan scan_at(const std::vector<Wall>& walls, const Pose2& T_world_laser, double stamp_s, RandomStream& random) {
  RangeScan scan;
  scan.stamp_s = stamp_s;
  scan.angle_min_rad = -0.5 * kPi;
  scan.angle_increment_rad = kPi / 360.0;
  scan.range_max_m = 30.0;
  for (int ray = 0; ray <= 360; ++ray) {
    const double angle = T_world_laser.yaw_rad + scan.angle_min_rad + ray * scan.angle_increment_rad;
    const double range_m = cast(walls, T_world_laser.x_m, T_world_laser.y_m, std::cos(angle), std::sin(angle));
    scan.range_m.push_back(static_cast<float>(range_m + random.normal(0.0, 0.008)));
  }
  return scan;
}

}  // namespace knav::flat_world
