#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "core/pose2.h"

namespace knav {

/// As LocalizationStatus.msg.
enum class LocalizationVerdict : std::uint8_t { kOk = 0, kUncertain = 1, kLost = 2, kInitializing = 3 };

const char* verdict_name(LocalizationVerdict verdict);

struct LocalizerResult {
  double stamp_s = 0.0;
  bool accepted = false;        ///< false: the scan or the motion was no good; `reason` says why
  bool has_pose = false;        ///< false until there is any idea where the robot is
  bool filter_updated = false;  ///< the particles were weighed with this scan
  Pose2 T_map_base;             ///< at stamp_s
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< (x [m], y [m], yaw [rad]) in the map frame
  LocalizationVerdict verdict = LocalizationVerdict::kInitializing;
  std::string reason;
  double inlier_fraction = 0.0;  ///< explained / (explained + unexplained), of this scan
  double support = 0.0, fresh_support = 0.0;  ///< smoothed; see Health
  std::uint32_t explained_rays = 0, unexplained_rays = 0, unknown_rays = 0;
  double position_sd_m = 0.0;  ///< largest principal standard deviation
  double yaw_sd_rad = 0.0;
  std::uint32_t particles = 0;
  std::uint32_t motion_epoch = 0;
};

}  // namespace knav
