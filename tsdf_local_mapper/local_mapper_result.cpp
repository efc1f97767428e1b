#include "tsdf_local_mapper/local_mapper_result.h"

namespace knav {

const char* to_string(FrameOutcome outcome) {
  switch (outcome) {
    case FrameOutcome::kAligned:
      return "aligned";
    case FrameOutcome::kStarted:
      return "started";
    case FrameOutcome::kNoReadings:
      return "no readings";
    case FrameOutcome::kParked:
      return "parked";
    case FrameOutcome::kSuspicious:
      return "suspicious";
    case FrameOutcome::kDuplicate:
      return "duplicate";
    case FrameOutcome::kOutOfOrder:
      return "out of order";
    case FrameOutcome::kWaitForOdometry:
      return "waiting for odometry";
    case FrameOutcome::kNoOdometry:
      return "no odometry";
    case FrameOutcome::kBadFrame:
      return "bad frame";
  }
  return "?";
}

const char* to_string(EpochReason reason) {
  switch (reason) {
    case EpochReason::kStart:
      return "start";
    case EpochReason::kReset:
      return "reset";
    case EpochReason::kClockJump:
      return "clock jumped back";
    case EpochReason::kOdometryGap:
      return "odometry gap";
    case EpochReason::kOdometryJump:
      return "odometry jumped";
    case EpochReason::kCarried:
      return "carried";
  }
  return "?";
}

}  // namespace knav
