#include "tsdf_local_mapper/local_map.h"

#include <algorithm>
#include <cstdlib>

namespace knav {

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
}

}  // namespace knav
