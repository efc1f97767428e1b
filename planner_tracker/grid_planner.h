#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/pose2.h"
#include "planner_tracker/combined_map.h"
#include "planner_tracker/planner_tracker_config.h"

namespace knav {

enum class PlanCode { kOk, kStartBlocked, kGoalOccupied, kGoalUnknown, kNoPath };

struct PlanResult {
  PlanCode code = PlanCode::kNoPath;
  Point2 at;                 ///< the offending point, unless kOk
  std::vector<Point2> path;  ///< corners of a polyline, start and goal included
  double length_m = 0.0;
  double cost_m = 0.0;  ///< length, dearer near obstacles
  int expanded = 0;     ///< nodes taken from the open list
};

/// Shortest clearance-aware paths: A* on every second cell, 16 neighbours, bucket queue, then pulled straight
/// where that is not dearer. The straight distance is its only bound: bounds prepared from the map
/// (landmarks) would be blind to doors that opened since, and 3 ms for 27 m across a hospital need none.
/// Where every second cell finds nothing, every cell is searched. A cell is driven on only if the whole
/// footprint disc, hard clearance included, lies over free cells.
class GridPlanner {
 public:
  explicit GridPlanner(const PlannerTrackerConfig& config);
  ~GridPlanner();

  /// @param layer  the map without what changes; goals it cannot reach on this layer it refuses at once
  void set_map(const MapLayer& layer);
  /// From now on ways may be as narrow as one once taken (ClearanceConfig::keep): for a goal to which nothing else leads.
  void set_narrow(bool narrow);
  bool narrow() const;
  /// @param layer same geometry as given to set_map
  void plan(const MapLayer& layer, const Point2& start, const Point2& goal, PlanResult* result);

  /// Cost [m] of driving straight, +Inf if something is in the way.
  double segment_cost_m(const MapLayer& layer, const Point2& from, const Point2& to) const;
  /// The same of a way once taken, which may be a little narrower, see ClearanceConfig::keep.
  double kept_cost_m(const MapLayer& layer, const Point2& from, const Point2& to) const;
  /// True if the robot can stand there.
  bool open(const MapLayer& layer, const Point2& point) const;
  /// The same on a way once taken.
  bool kept_open(const MapLayer& layer, const Point2& point) const;
  /// Nearest point where the robot can stand, within `within_m`; false if there is none.
  bool nearest_open(const MapLayer& layer, const Point2& point, double within_m, Point2* found) const;

 private:
  struct Search;
  std::unique_ptr<Search> search_;
};

}  // namespace knav
