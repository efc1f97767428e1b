#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "global_map_builder/closure_finder.h"
#include "global_map_builder/drive_recorder.h"
#include "global_map_builder/map_builder_config.h"
#include "global_map_builder/map_contour.h"
#include "global_map_builder/map_directory.h"

namespace knav {

struct BuiltMap {
  MapDirectory map;  ///< with the corrected trajectory; the start pose is the origin
  Contour contour;
  PoseGraph graph;
  std::vector<Closure> closures;
  std::vector<Pose2> keyframes;  ///< T_map_base, by the numbers that closures use
  Trajectory drive, odometry;    ///< uncorrected, at the map trajectory's stamps, from the origin
  int mended_steps = 0;          ///< where the mapper jumped
  std::map<std::string, double> stage_s;
};

/// From a recording to a global map (paper section III.G): the local mapper's trajectory, closures, robust
/// graph optimisation, one signed distance grid from the corrected trajectory, its contour and the true
/// distance to it. Not thread safe. The same calls give the same bytes.
class MapBuilder {
 public:
  MapBuilder(const MapBuilderConfig& config, const LocalMapperConfig& mapper);

  // In the order of stamps, odometry a little ahead of the observations.
  void add_odometry(double stamp_s, const Pose2& T_odom_base) { drive_.add_odometry(stamp_s, T_odom_base); }
  void add(const DepthProfile& profile, const Pose2& T_base_camera) { drive_.add(profile, T_base_camera); }
  void add(const RangeScan& scan, const Pose2& T_base_sensor) { drive_.add(scan, T_base_sensor); }
  /// The button: the robot stands at a marked place. Marks of one place close a loop.
  void mark(double stamp_s) { drive_.mark(stamp_s); }

  const DriveRecorder& drive() const { return drive_; }

  /// @param progress stage and the fraction of it done; may throw to stop
  /// UserError if nothing that can be mapped was added. Call once.
  BuiltMap build(const std::function<void(const char* stage, double fraction)>& progress = {});

 private:
  MapBuilderConfig config_;
  DriveRecorder drive_;
};

}  // namespace knav
