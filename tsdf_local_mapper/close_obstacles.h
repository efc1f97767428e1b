#pragma once

#include <vector>

#include "core/depth_profile.h"
#include "core/grid_geometry.h"
#include "core/pose2.h"
#include "core/range_scan.h"
#include "core/tsdf_grid.h"

namespace knav {

/// What is too near for a depth camera to see.
struct CloseObstaclesConfig {
  double distance_m = 0.35;
  double width_deg = 2.5;
  double memory_s = 5.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("distance_m", distance_m, 0, 1, "m",
             "Columns that showed something and suddenly show nothing at all, not even the floor, have an obstacle before "
             "them at this depth in local_map and scan_360: somebody stepped so close that the camera cannot see him. 0 = off.");
    v.number("width_deg", width_deg, 0.1, 60, "deg", "So wide a stretch of columns, at least; less is a hole in the image.");
    v.number("memory_s", memory_s, 0, 60, "s", "Once out of view it is remembered for so long.");
  }
};

/// A Kinect answers nothing nearer than half a metre, and the robot stops within half a metre: who steps into its way from
/// the side, or is met in a turn, is in no reading. But he hides the floor and all behind him. A column counts from when it
/// shows nothing, if it showed something half a second before, until it shows something again: columns that never
/// show anything (a registered image's border) do not count. Nor do those before which the map has a surface so near, nor its
/// shadow beside it (projector and camera look past its edge from two places): a robot that turns beside a wall, or drives
/// through a door, knows what it does not see.
class CloseObstacles {
 public:
  explicit CloseObstacles(const CloseObstaclesConfig& config) : config_(config) {}

  void reset();
  void update(const DepthProfile& profile, const Pose2& T_local_camera, const TsdfGrid& grid);

  /// Shortens the rays that meet one; they carry no evidence, for where exactly it stands is not known.
  void add_to(const Pose2& T_local_base, RangeScan* scan) const;
  void add_to(OccupancyGrid* local_map) const;

 private:
  void find_blind_columns(const DepthProfile& profile);
  static std::size_t shadow_columns(const DepthProfile& profile, std::size_t first, std::size_t end);
  std::size_t fewest_columns(const DepthProfile& profile) const;
  bool goes_blind(std::size_t column, double stamp_s) const;
  void forget(const DepthProfile& profile, const Pose2& T_local_camera);
  static double left_per_m(const DepthProfile& profile, std::size_t column);
  static float known_depth(const Pose2& T_local_camera, double left_per_m, const TsdfGrid& grid);
  bool hides(std::size_t column) const;
  void hold_between(const DepthProfile& profile, const Pose2& T_local_camera, std::size_t first, std::size_t end);
  void hold(const Point2& in_local, double stamp_s);

  struct Held {
    Point2 in_local;
    double seen_s;
  };
  CloseObstaclesConfig config_;
  std::vector<double> shown_s_;     ///< per column: when it last showed something
  std::vector<std::uint8_t> lost_;  ///< per column: it stopped doing so
  std::vector<float> known_depth_m_;  ///< per lost column: of the surface that the map has there
  std::vector<Held> held_;
};

}  // namespace knav
