#pragma once

#include "core/pose2.h"
#include "planner_tracker/combined_map.h"

namespace knav {

/// Length [m] of a short path by Theta* over every cell (Nash et al., "Theta*: Any-Angle Path Planning on
/// Grids", 2007), keeping a clearance and nothing else; +Inf if there is none. Slow and simple: what tests
/// and planner_benchmark compare GridPlanner with.
double theta_star_length_m(const MapLayer& layer, double clearance_m, const Point2& start,
                           const Point2& goal);

}  // namespace knav
