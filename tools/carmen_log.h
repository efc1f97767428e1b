#pragma once

#include <string>
#include <vector>

#include "core/pose2.h"

namespace knav {

/// One FLASER line of a CARMEN log.
struct CarmenScan {
  double stamp_s = 0.0;
  Pose2 T_odom_laser;
  Pose2 T_odom_robot;
  std::vector<float> range_m;  ///< over 180 deg, from right to left; 81.91 (or 81.83) = nothing came back
};

/// One ODOM line.
struct CarmenOdometry {
  double stamp_s = 0.0;
  Pose2 T_odom_robot;
};

struct CarmenLog {
  std::vector<CarmenScan> scans;
  std::vector<CarmenOdometry> odometry;
};

/// UserError names file and line of a fault.
CarmenLog read_carmen_log(const std::string& path);

}  // namespace knav
