#include "tsdf_local_mapper/local_map.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "core/multiversion.h"
#include "core/surface_code.h"

namespace knav {
namespace {

constexpr std::int8_t kSurface = 100, kLookAt = 101;

/// How far beyond the middle of a surface's cell F changes its sign, going on from a free cell beside it, in cells; negative before it.
/// NaN where it does not near it: along the surface.
double crossing_beyond(const TsdfGrid& grid, int ix, int iy, int step_x, int step_y) {
  const int free = grid.value(ix - step_x, iy - step_y), here = grid.value(ix, iy), behind = grid.value(ix + step_x, iy + step_y);
  if (here > 0 && behind != TsdfGrid::kUnknown && behind < 0) return static_cast<double>(here) / (here - behind);
  return free > here ? static_cast<double>(here) / (free - here) : std::numeric_limits<double>::quiet_NaN();
}

/// Writes into the free cell where the surfaces beside it are: along the axis along which F changes most.
void write_surface_code(const TsdfGrid& grid, int low_x, int low_y, int x, int y, OccupancyGrid* map) {
  constexpr double kSlack = 0.1;  // of noise, about the cell's edges
  const GridGeometry& g = map->geometry;
  if (x < 1 || y < 1 || x + 1 >= g.width_cells || y + 1 >= g.height_cells) return;
  std::int8_t& free = map->value[g.index(x, y)];
  if (free < 0 || free == kSurface) return;
  int steepest = 0;
  for (int side = 0; side < 4; ++side) {
    const int step_x = side == 0 ? 1 : side == 1 ? -1 : 0, step_y = side == 2 ? 1 : side == 3 ? -1 : 0;
    if (map->value[g.index(x + step_x, y + step_y)] != kSurface) continue;
    const int fall = grid.value(low_x + x, low_y + y) - grid.value(low_x + x + step_x, low_y + y + step_y);
    const double beyond = crossing_beyond(grid, low_x + x + step_x, low_y + y + step_y, step_x, step_y);
    if (fall <= steepest || !(std::abs(beyond) < 0.5 + kSlack)) continue;
    steepest = fall;
    free = SurfaceCode::of(step_y == 0, 1.0 + beyond);
  }
}

std::int8_t occupancy_of(const TsdfGrid& grid, const SurfaceRule& rule, int ix, int iy) {
  const int value = grid.value(ix, iy);
  if (value == TsdfGrid::kUnknown) return -1;
  // Of two cells with the crossing between them, the one nearer to it is the surface.
  const int neighbours[4] = {grid.value(ix + 1, iy), grid.value(ix - 1, iy), grid.value(ix, iy + 1), grid.value(ix, iy - 1)};
  bool surface = value == 0;
  for (const int other : neighbours) {
    if (other == TsdfGrid::kUnknown || (value > 0) == (other > 0)) continue;
    if (!rule.near(value) && !rule.near(other)) continue;
    if (std::abs(value) < std::abs(other) || (std::abs(value) == std::abs(other) && value < 0)) surface = true;
  }
  return surface ? kSurface : value > 0 ? 0 : -1;
}

/// A cell whose F is farther from 0 than `limit` is no surface, whatever is beside it: of two with the crossing between them one must
/// be near 0, and the nearer one is the surface. Free or unknown, then; the others are to be looked at.
KNAV_MULTIVERSION
void classify(const std::int8_t* value, int count, std::int8_t limit, std::int8_t* occupancy) {
  for (int k = 0; k < count; ++k) {
    const std::int8_t far = value[k] > limit ? std::int8_t{0} : std::int8_t{-1};
    occupancy[k] = (value[k] <= limit) & (value[k] >= -limit) ? kLookAt : far;
  }
}

int next_to_look_at(const std::int8_t* row, int from, int width) {
  const void* const found = std::memchr(row + from, kLookAt, static_cast<std::size_t>(width - from));
  return found ? static_cast<int>(static_cast<const std::int8_t*>(found) - row) : width;
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
  map->value.resize(map->geometry.cell_count());
  static thread_local std::vector<std::pair<int, int>> surfaces;
  surfaces.clear();
  const int mask = grid.size_cells() - 1;
  const auto limit = static_cast<std::int8_t>(std::min(rule.limit, 127));
  for (int iy = low_y; iy < high_y; ++iy) {
    std::int8_t* const row = map->value.data() + map->geometry.index(0, iy - low_y);
    for (int ix = low_x; ix < high_x;) {  // the torus cuts a row in two pieces at most
      const int piece = std::min(high_x - ix, grid.size_cells() - (ix & mask));
      classify(grid.values() + grid.index(ix, iy), piece, limit, row + (ix - low_x));
      ix += piece;
    }
    const int width = map->geometry.width_cells;
    for (int x = next_to_look_at(row, 0, width); x < width; x = next_to_look_at(row, x + 1, width)) {
      row[x] = occupancy_of(grid, rule, low_x + x, iy);
      if (row[x] == kSurface) surfaces.emplace_back(x, iy - low_y);
    }
  }
  for (const auto& [x, y] : surfaces) {
    for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) write_surface_code(grid, low_x, low_y, x + dx, y + dy, map);
  }
}

}  // namespace knav
