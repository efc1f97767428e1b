#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "core/random.h"
#include "kinect_sim/world.h"
#include "planner_tracker/combined_map.h"
#include "planner_tracker/grid_planner.h"

namespace knav {

/// Where a robot can go in a building, from the building itself: for laying out tours and changes.
class FloorPlan {
 public:
  /// @param robot_radius_m  of the robot that must get through
  /// UserError if the building is larger than 1 km in a direction.
  FloorPlan(const WorldConfig& world, double robot_radius_m);

  /// A leg's way over the floor; empty if there is none.
  std::vector<Point2> path(const Point2& from, const Point2& to) const;
  /// To anything that stands there while nothing has changed [m]; exact up to 1.5 m.
  double clearance_m(const Point2& p) const { return map_.global().clearance_m(p.x_m, p.y_m); }

  /// True if all points are connected, for a robot with 7 cm to spare on each side, once these stand there
  /// too.
  bool connected(const std::vector<Point2>& points, const std::vector<Solid>& added) const;
  /// Points that can be reached from the start with this clearance, 0.2 m apart, once these stand there too.
  std::vector<Point2> reachable(double clearance_m, const std::vector<Solid>& added = {}) const;
  /// False if what is reached from the start is the open ground round the building, or if the start is not free.
  bool starts_inside() const;
  /// A point with the most room round it, up to 1.5 m, in the largest part of the building that walls close off; none if nothing is
  /// closed off.
  std::optional<Point2> start_inside() const;

 private:
  std::vector<char> open_cells(double clearance_m) const;
  std::vector<char> flood(const std::vector<Solid>& added, double clearance_m) const;
  void flood_from(int ix, int iy, const std::vector<char>& open, std::vector<char>* seen, std::vector<std::size_t>* found) const;
  std::vector<char> outside(const std::vector<char>& open) const;

  double robot_radius_m_;
  Point2 start_;
  CombinedMap map_;
  mutable GridPlanner planner_;
};

/// Length of a polyline [m].
double length_m(const std::vector<Point2>& path);
/// The point after this length; the last one if it is shorter.
Point2 point_along(const std::vector<Point2>& path, double along_m);

}  // namespace knav
