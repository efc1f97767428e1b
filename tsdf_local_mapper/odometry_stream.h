#pragma once

#include "core/pose2.h"
#include "core/pose_buffer.h"
#include "tsdf_local_mapper/local_mapper_config.h"

namespace knav {

/// Odometry as a robot really sends it, to be asked for the pose at a frame's stamp: notices that it was silent, was set
/// back to zero, or that the clock jumped back, after which nothing links what came before with what comes.
class OdometryStream {
 public:
  explicit OdometryStream(const ContinuityConfig& config) : config_(config) {}

  /// Poses and stamps that are not finite, and stamps that do not rise, are ignored; a stamp older by more than
  /// clock_jump_s begins anew.
  void add(double stamp_s, const Pose2& T_odom_base);
  PoseBuffer::Lookup at(double stamp_s, Pose2* T_odom_base) const;

  /// What broke it since this was last asked.
  enum class Break { kNone, kGap, kJump };
  Break take_break();

  /// A frame's stamp says so; odometry that is from after it, all of it, is forgotten.
  void clock_jumped_back_to(double stamp_s);
  void clear();

 private:
  ContinuityConfig config_;
  PoseBuffer poses_;
  Break break_ = Break::kNone;
};

}  // namespace knav
