#pragma once

#include "core/contour.h"
#include "tsdf_local_mapper/local_mapper_config.h"

namespace knav {

/// Compares a frame with what the map shows from the estimated pose. People and moved things stand in front of the map's surfaces,
/// but what is seen beside them still meets the map, unless they fill the view from right before the camera. Only a robot that is
/// elsewhere than it believes looks through most of the surfaces, or sees others before nearly all of them. When somebody who
/// stood close before the camera leaves, it looks through him, but what it sees beside him still meets the map.
class ViewCheck {
 public:
  ViewCheck(const ContinuityConfig& config, const ContourConfig& contour, double range_max_m)
      : config_(config), contour_(contour), range_max_m_(range_max_m) {}

  void reset() { suspicious_s_ = 0.0; }
  /// @param dt_s since the last frame
  void update(const TsdfGrid& grid, const TsdfObservation& observation, const Pose2& T_map_sensor,
              double dt_s);

  bool suspicious() const { return suspicious_; }
  /// It has been so for long enough.
  bool carried() const { return suspicious_s_ >= config_.carried_after_s; }
  double agree_fraction() const { return agree_; }
  double see_through_fraction() const { return through_; }

 private:
  ContinuityConfig config_;
  ContourConfig contour_;
  double range_max_m_;
  bool suspicious_ = false;
  double suspicious_s_ = 0.0;
  double agree_ = 0.0, through_ = 0.0;
};

}  // namespace knav
