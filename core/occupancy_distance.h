#pragma once

#include "core/distance_map.h"
#include "core/grid_geometry.h"

namespace knav {

/// The signed distance map of an occupancy grid that carries no contour (a plain map_server map): occupied
/// from 65 up, free to 25, else unknown, as map_server's default thresholds. A wall's surface is the outer
/// edge of its cells, half a cell before their centres: positive in free cells, negative in occupied ones,
/// NaN in unknown ones. UserError if the grid's size and data disagree.
DistanceMap distance_from_occupancy(const OccupancyGrid& occupancy);

}  // namespace knav
