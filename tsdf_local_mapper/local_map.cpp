#include "tsdf_local_mapper/local_map.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "core/surface_code.h"

namespace knav {
namespace {

/// How far beyond the middle of a surface's cell F changes its sign, going on from a free cell beside it, in cells; negative before it.
/// NaN where it does not near it: along the surface.
double crossing_beyond(const TsdfGrid& grid, int ix, int iy, int step_x, int step_y) {
  const int free = grid.value(ix - step_x, iy - step_y), here = grid.value(ix, iy), behind = grid.value(ix + step_x, iy + step_y);
  if (here > 0 && behind != TsdfGrid::kUnknown && behind < 0) return static_cast<double>(here) / (here - behind);
  return free > here ? static_cast<double>(here) / (free - here) : std::numeric_limits<double>::quiet_NaN();
}

/// Writes into the free cells beside the surfaces where these are: along the axis along which F changes most.
void write_surface_codes(const TsdfGrid& grid, int low_x, int low_y, OccupancyGrid* map) {
  constexpr double kSlack = 0.1;  // of noise, about the cell's edges
  const GridGeometry& g = map->geometry;
  for (int y = 1; y + 1 < g.height_cells; ++y) {
    for (int x = 1; x + 1 < g.width_cells; ++x) {
      std::int8_t& free = map->value[g.index(x, y)];
      if (free < 0 || free == 100) continue;
      int steepest = 0;
      for (int side = 0; side < 4; ++side) {
        const int step_x = side == 0 ? 1 : side == 1 ? -1 : 0, step_y = side == 2 ? 1 : side == 3 ? -1 : 0;
        if (map->value[g.index(x + step_x, y + step_y)] != 100) continue;
        const int fall = grid.value(low_x + x, low_y + y) - grid.value(low_x + x + step_x, low_y + y + step_y);
        const double beyond = crossing_beyond(grid, low_x + x + step_x, low_y + y + step_y, step_x, step_y);
        if (fall <= steepest || !(std::abs(beyond) < 0.5 + kSlack)) continue;
        steepest = fall;
        free = SurfaceCode::of(step_y == 0, 1.0 + beyond);
      }
    }
  }
}

}  // namespace

void extract_occupancy(const TsdfGrid& grid, double center_x_m, double center_y_m, double size_m,
                       const SurfaceRule& rule, OccupancyGrid* map) {
  const int half = static_cast<int>(0.5 * size_m / grid.resolution_m());
  const int low_x = std::max(grid.first_x() + 1, grid.cell_of(center_x_m) - half);
  const int low_y = std::max(grid.first_y() + 1, grid.cell_of(center_y_m) - half);
  const int high_x = std::min(grid.first_x() + grid.size_cells() - 1, grid.cell_of(center_x_m) + half + 1);
  const int high_y = std::min(grid.first_y() + grid.size_cells() - 1, grid.cell_of(center_y_m) + half + 1);
  map->geometry = {high_x - low_x, high_y - low_y, grid.resolution_m(), low_x * grid.resolution_m(),
                   low_y * grid.resolution_m()};
  map->value.assign(map->geometry.cell_count(), -1);
  std::size_t out = 0;
  for (int iy = low_y; iy < high_y; ++iy) {
    for (int ix = low_x; ix < high_x; ++ix, ++out) {
      const int value = grid.value(ix, iy);
      if (value == TsdfGrid::kUnknown) continue;
      // Of two cells with the crossing between them, the one nearer to it is the surface.
      const int neighbours[4] = {grid.value(ix + 1, iy), grid.value(ix - 1, iy), grid.value(ix, iy + 1),
                                 grid.value(ix, iy - 1)};
      bool surface = value == 0;
      for (const int other : neighbours) {
        if (other == TsdfGrid::kUnknown || (value > 0) == (other > 0)) continue;
        if (!rule.near(value) && !rule.near(other)) continue;
        if (std::abs(value) < std::abs(other) || (std::abs(value) == std::abs(other) && value < 0))
          surface = true;
      }
      if (surface) {
        map->value[out] = 100;
      } else if (value > 0) {
        map->value[out] = 0;
      }
    }
  }
  write_surface_codes(grid, low_x, low_y, map);
}

}  // namespace knav
