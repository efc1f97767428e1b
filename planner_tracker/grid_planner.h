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
  Point2 at;                    ///< the offending point, unless kOk
  std::vector<Point2> path;     ///< corners of a polyline, start and goal included
  double length_m = 0.0;
  double cost_m = 0.0;          ///< length, dearer near obstacles
  int expanded = 0;             ///< nodes taken from the open list
};

/// Shortest clearance-aware paths: A* on every second cell with landmark distances as its heuristic (Goldberg and
/// Harrelson, "Computing the Shortest Path: A* Search Meets Graph Theory", 2005), then pulled straight where that
/// is not dearer. Where every second cell finds nothing, every cell is searched. A cell is driven on only if the
/// whole footprint disc, hard clearance included, lies over free cells.
class GridPlanner {
 public:
  explicit GridPlanner(const PlannerTrackerConfig& config);
  ~GridPlanner();

  /// Prepares the landmarks; `layer` is the map without what changes (seconds on a map of a hectare or more).
  void set_map(const MapLayer& layer);
  /// @param layer same geometry as given to set_map
  /// @param landmarks  use the bounds of the map given to set_map: much faster, but a shortcut that opened since (a
  ///   door shut in the map) may be overlooked. Without them the straight distance is the only bound.
  void plan(const MapLayer& layer, const Point2& start, const Point2& goal, PlanResult* result, bool landmarks = true);

  /// Cost [m] of driving straight, +Inf if something is in the way.
  double segment_cost_m(const MapLayer& layer, const Point2& from, const Point2& to) const;
  /// True if the robot can stand there.
  bool open(const MapLayer& layer, const Point2& point) const;
  /// Nearest point where the robot can stand, within `within_m`; false if there is none.
  bool nearest_open(const MapLayer& layer, const Point2& point, double within_m, Point2* found) const;

 private:
  struct Search;
  std::unique_ptr<Search> search_;
};

}  // namespace knav
