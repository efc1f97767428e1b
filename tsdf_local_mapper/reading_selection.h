#pragma once

#include <cstdint>

#include "core/motion_model.h"
#include "core/tsdf_grid.h"
#include "core/tsdf_observation.h"
#include "core/weighted_points.h"
#include "tsdf_local_mapper/local_mapper_config.h"

namespace knav {

/// Which of a frame's readings have a say in the robot's pose, and how much.
class ReadingSelection {
 public:
  ReadingSelection(const FilterConfig& config, const MotionModelConfig& motion) : config_(config), motion_(motion) {}

  /// At most config.readings, evenly over the valid columns, in the robot's frame. One that lies near where nothing was until
  /// now is somebody who moves, and left out.
  /// @param next_sequence   of the observation about to enter the grid
  /// @param T_local_before  the last estimate
  /// @param T_step          how far odometry says that the robot has moved since, in dt_s
  /// @return valid until the next call; the filter goes on weighing it
  WeightedPoints& select(const TsdfObservation& observation, const Pose2& T_base_sensor, const TsdfGrid& grid,
                         std::uint32_t next_sequence, const Pose2& T_local_before, const Pose2& T_step, double dt_s);
  /// Share of the view's columns that the last selection stands for.
  double coverage() const { return coverage_; }

 private:
  enum class Come { kNo, kPerhaps, kYes };

  float weight_of(const TsdfObservation& observation, std::size_t column) const;
  double moving_range_m(const Pose2& T_step) const;
  static Come has_come(const TsdfGrid& grid, std::uint32_t next_sequence, const Pose2& T_local_point, double range_m, double dt_s);

  FilterConfig config_;
  MotionModelConfig motion_;
  WeightedPoints points_, doubtful_;
  double coverage_ = 0.0;
};

}  // namespace knav
