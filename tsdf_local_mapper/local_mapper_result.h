#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

#include "core/pose2.h"

namespace knav {

/// What became of a frame.
enum class FrameOutcome {
  kAligned,          ///< compared with the map and integrated
  kStarted,          ///< the first frame of a map
  kNoReadings,       ///< too few readings to align; the pose follows odometry
  kParked,           ///< the wheels stand; the pose is kept
  kSuspicious,       ///< does not fit the map; the pose follows odometry, nothing was integrated
  kDuplicate,        ///< not accepted: this stamp was seen
  kOutOfOrder,       ///< not accepted: older than the newest frame
  kWaitForOdometry,  ///< not accepted: newer than odometry; ask again when more has come
  kNoOdometry,       ///< not accepted: odometry does not reach back so far, or has a gap there
  kBadFrame,         ///< not accepted: no columns, or a nonsensical model or stamp
};
const char* to_string(FrameOutcome outcome);

/// Why the epoch changed last.
enum class EpochReason { kStart, kReset, kClockJump, kOdometryGap, kOdometryJump, kCarried };
const char* to_string(EpochReason reason);

struct LocalMapperResult {
  bool accepted = false;
  FrameOutcome outcome = FrameOutcome::kBadFrame;
  std::string reason;  ///< a sentence if not accepted or if the epoch changed, else empty
  double stamp_s = 0.0;
  Pose2 T_local_base;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< (x, y, yaw) in the local map's frame [m, rad]
  std::uint32_t epoch = 0;
  EpochReason epoch_reason = EpochReason::kStart;
  Pose2 T_odom_base;  ///< odometry at the frame's stamp

  // For diagnostics.
  double cost = 0.0;  ///< of the estimate, 0 ... 1 (NaN if nothing was compared)
  double effective_particles = 0.0;
  double particle_lifespan_s = 0.0;   ///< until nine in ten of a generation had no descendants left
  double agree_fraction = 0.0;        ///< readings on known rays that meet the map's surface
  double see_through_fraction = 0.0;  ///< ... that lie behind it
  int observations = 0;               ///< held in the map
};

}  // namespace knav
