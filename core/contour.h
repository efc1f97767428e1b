#pragma once

#include <string>
#include <vector>

#include "core/range_scan.h"
#include "core/tsdf_grid.h"

namespace knav {

struct ContourConfig {
  int rays = 3600;
  double range_max_m = 20.0;
  double blind_radius_m = 1.5;
  double unknown_gap_m = 0.15;
  double surface_within = 0.2;
  double evidence_decay_s = 30.0;
  bool merge_newest = true;

  template <class Visitor>
  void visit(Visitor& v) {
    v.integer("rays", rays, 36, 36000, "", "Rays of the virtual scan, over 360 degrees.");
    v.number("range_max_m", range_max_m, 1, 100, "m", "Length of a ray.");
    v.number("blind_radius_m", blind_radius_m, 0, 10, "m",
             "Cells never seen this near to the robot do not end a ray; farther out they make it unknown.");
    v.number("unknown_gap_m", unknown_gap_m, 0, 2, "m", "A ray may cross unknown cells for this length.");
    v.number("surface_within", surface_within, 0.05, 1, "",
             "F must come this near to 0 beside a change of its sign for a surface to be there; elsewhere it is the edge "
             "of what a surface hides. 1: any change of sign (the paper's).");
    v.number("evidence_decay_s", evidence_decay_s, 0.1, 10000, "s",
             "A ray's evidence is exp(-age / this), age by the window's clock.");
    v.flag("merge_newest", merge_newest,
           "Replace the section that the newest profile covers by its readings.");
  }
};

/// A change of F's sign is a surface only where F was measured near 0. Beside the last column that meets a wall, free
/// space borders on cells that this column passed on its way into the wall, whose F is -0.4 or -1: there is a shadow's
/// edge, not a surface. Taken for one it narrows every door that the robot drives up to along its wall.
struct SurfaceRule {
  explicit SurfaceRule(double surface_within) : limit(static_cast<int>(surface_within * TsdfGrid::kValueScale)) {}
  bool near(int value) const { return value != TsdfGrid::kUnknown && value <= limit && value >= -limit; }
  /// Any corner of a quad.
  bool near_in(std::uint32_t quad) const {
    for (int corner = 0; corner < 4; ++corner) {
      if (near(static_cast<std::int8_t>((quad >> (8 * corner)) & 0xFFu))) return true;
    }
    return false;
  }
  int limit;
};

/// Paper section III.F: the surface seen from a pose. Every cell on each ray is visited, the crossing from
/// positive to negative located by interpolation. Ray i points to the angle -pi + i 2 pi / rays in the
/// robot's frame. A return in metres; +Inf = known free up to range_max; NaN = unknown.
/// @param now_age_clock_s the window's clock now, for the evidence
void extract_contour(const TsdfGrid& grid, const ContourConfig& config, const Pose2& T_map_robot,
                     float now_age_clock_s, RangeScan* scan);

/// How one ray ends, by the same rule.
struct RayEnd {
  enum class Kind { kSurface, kFree, kUnknown } kind = Kind::kUnknown;
  float range_m = 0.0f;      ///< of the surface, or where the ray became unknown, or the ray's length
  float last_seen_s = 0.0f;  ///< window clock of the newest cell at the surface there, or at a free ray's end
};
RayEnd cast_ray(const TsdfGrid& grid, const ContourConfig& config, double x_m, double y_m, double dir_x,
                double dir_y, double length_m);

/// Section III.H: replaces the section of the scan that the newest observation covers, after converting it
/// from its own pose and columns to the robot's frame and angles. Between columns of one surface it is
/// interpolated; columns without a return keep what the map says. Evidence there becomes 1.
void merge_newest(const TsdfObservation& observation, const Pose2& T_map_robot, RangeScan* scan);

}  // namespace knav
