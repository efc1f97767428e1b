#pragma once

#include <vector>

#include "core/grid_geometry.h"
#include "core/pose2.h"
#include "kinect_sim/world.h"

namespace knav {

/// Distances to what stands in a building. A coarse grid names the prisms near a point; they answer exactly.
class CollisionMap {
 public:
  /// @param world must outlive this object
  /// @param height_m what begins above this is passed under
  CollisionMap(const WorldConfig& world, double height_m);

  /// Distance [m] from a point to the nearest solid, doors and timed pieces as last set included; exact up to
  /// 0.75 m, and never more than that.
  double clearance_m(const Point2& point) const;
  /// Distance [m] to the nearest stairs; 0 over them, +Inf if there are none.
  double stairs_distance_m(const Point2& point) const;
  void set_doors(const std::vector<double>& door_open_rad);
  void set_timed(const std::vector<char>& present);

 private:
  bool touches(const Solid& solid) const { return solid.bottom_m < height_m_ && solid.top_m > 0.02; }

  const WorldConfig* world_;
  double height_m_;
  std::vector<Solid> solids_;
  GridGeometry bucket_geometry_;
  std::vector<std::vector<std::size_t>> bucket_;  ///< solids near each cell
  std::vector<Solid> doors_, timed_;
  std::vector<char> timed_present_;
};

}  // namespace knav
