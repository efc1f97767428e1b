#pragma once

#include "core/contour.h"
#include "core/grid_geometry.h"
#include "core/tsdf_grid.h"

namespace knav {

/// The part of the grid in a square round a point as an occupancy grid: a cell is a surface (100) where F
/// changes its sign to a known neighbour and SurfaceRule holds, free (0, beside a surface a SurfaceCode) where F is positive,
/// and unknown (-1) elsewhere: never seen, or behind a surface.
void extract_occupancy(const TsdfGrid& grid, double center_x_m, double center_y_m, double size_m,
                       const SurfaceRule& rule, OccupancyGrid* map);

}  // namespace knav
