#pragma once

#include "core/trajectory.h"
#include "tsdf_local_mapper/local_mapper.h"

namespace knav {

/// The robot's way as the local mapper tells it. Across epochs it goes on by odometry. It starts at the
/// origin.
class MapperTrajectory {
 public:
  /// Takes what the mapper said of a frame; one that was not accepted changes nothing.
  void add(const LocalMapperResult& result);

  const Trajectory& estimate() const { return estimate_; }
  const Trajectory& odometry() const { return odometry_; }  ///< at the same stamps
  int frames() const { return frames_; }
  int accepted() const { return static_cast<int>(estimate_.size()); }
  int epochs() const { return epochs_; }
  double path_m() const { return path_m_; }

 private:
  Trajectory estimate_, odometry_;
  Pose2 T_map_local_;
  std::uint32_t epoch_ = 0;
  int frames_ = 0, epochs_ = 1;
  double path_m_ = 0.0;
};

}  // namespace knav
