#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/grid_geometry.h"

namespace knav {

/// An occupancy grid says which cell a surface is in, and nothing of where in it. local_map's free cells beside one say that as well:
/// their values 1 to 24, which every reader of occupancy grids takes for free, are how far from the cell's middle the surface cuts the
/// line to the middle of the occupied cell, in twelfths of a cell: 1 to 12 along x, 13 to 24 along y. 0 says nothing.
struct SurfaceCode {
  static constexpr int kSteps = 12;
  static constexpr double kNearest = 0.5, kFarthest = 1.5;  ///< in cells: the occupied cell's edges
  static constexpr std::int8_t kMost = 2 * kSteps;

  /// @param cells  from the free cell's middle to the surface, kNearest to kFarthest
  static std::int8_t of(bool along_x, double cells) {
    const int step = std::clamp(static_cast<int>((cells - kNearest) * kSteps), 0, kSteps - 1);
    return static_cast<std::int8_t>(1 + step + (along_x ? 0 : kSteps));
  }
  static bool is_code(std::int8_t value) { return value >= 1 && value <= kMost; }
  static bool along_x(std::int8_t code) { return code <= kSteps; }
  static double cells(std::int8_t code) { return kNearest + ((code - 1) % kSteps + 0.5) / kSteps; }
};

/// Where in an occupied cell of a grid with surface codes its surface is, from the cell's middle [cells]; the middle itself if no cell
/// beside it says.
inline Point2 surface_in_cell(const OccupancyGrid& grid, int ix, int iy) {
  double across[2] = {0.0, 0.0};  // where it cuts the two lines through the cell's middle
  int cuts[2] = {0, 0};
  for (int axis = 0; axis < 2; ++axis) {
    for (const int side : {-1, 1}) {
      const int x = ix + (axis == 0 ? side : 0), y = iy + (axis == 1 ? side : 0);
      if (!grid.geometry.contains(x, y)) continue;
      const std::int8_t code = grid.value[grid.geometry.index(x, y)];
      if (!SurfaceCode::is_code(code) || SurfaceCode::along_x(code) != (axis == 0)) continue;
      across[axis] += side * (1.0 - SurfaceCode::cells(code));
      ++cuts[axis];
    }
    if (cuts[axis] > 1) across[axis] /= cuts[axis];  // something thin, seen from both sides: its middle
  }
  if (cuts[0] == 0 || cuts[1] == 0) return {across[0], across[1]};
  // A line through both cuts: the point of it that is nearest to the middle.
  const double a = across[0], b = across[1], norm = a * a + b * b;
  return norm > 0.0 ? Point2{a * b * b / norm, a * a * b / norm} : Point2{};
}

}  // namespace knav
