#pragma once

#include <memory>

#include "core/depth_profile.h"
#include "core/grid_geometry.h"
#include "core/particle_filter.h"
#include "core/pose2.h"
#include "core/range_scan.h"
#include "core/tsdf_grid.h"
#include "tsdf_local_mapper/local_mapper_config.h"
#include "tsdf_local_mapper/local_mapper_result.h"

namespace knav {

/// Paper sections III.D-III.F: keeps a sliding-window signed distance map, estimates the robot's motion by
/// aligning each new profile with it, and looks round in it by 360 degrees. Not thread safe. Same input and
/// seed give the same bytes.
class LocalMapper {
 public:
  /// Throws UserError if the configuration is not valid.
  explicit LocalMapper(const LocalMapperConfig& config);
  ~LocalMapper();
  LocalMapper(const LocalMapper&) = delete;
  LocalMapper& operator=(const LocalMapper&) = delete;

  /// Stamps should rise; others are ignored, except a jump back, which restarts the mapper's odometry.
  void add_odometry(double stamp_s, const Pose2& T_odom_base);

  /// @param T_base_camera the levelled camera's planar pose, x = forward
  const LocalMapperResult& update(const DepthProfile& profile, const Pose2& T_base_camera);
  const LocalMapperResult& update(const RangeScan& scan, const Pose2& T_base_sensor);

  /// Whether the localizer, if there is one, knows where the robot is; while not, the map remembers less
  /// (WindowConfig::doubtful_distance_m).
  void set_in_doubt(bool in_doubt);

  /// The virtual 360-degree scan from the newest pose, in the robot's frame (section III.F, III.H).
  void extract_scan_360(RangeScan* scan) const;
  /// A square of the map round the robot, in the local map's frame: 0 free, 100 surface, -1 unknown.
  void extract_local_map(OccupancyGrid* map) const;
  /// Forgets map, pose and odometry; a new epoch.
  void reset();

  /// What was learned of the depth camera's steady errors.
  RangeOffsets range_offsets() const;
  /// Begins with what an earlier drive learned of them.
  void start_from(const RangeOffsets& offsets);

  const LocalMapperConfig& config() const;
  const LocalMapperResult& result() const;
  const TsdfGrid& grid() const;
  const ParticleSet& particles() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace knav
