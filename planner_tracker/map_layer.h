#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/grid_geometry.h"
#include "planner_tracker/truncated_distance.h"

namespace knav {

constexpr double kBody_m = 0.25;  ///< radius of somebody

enum class CellState : std::uint8_t {
  kUnknown = 0,
  kFree = 1,
  kOccupied = 2,
  kKeepout = 3,
  kSupposed = 4,  ///< nothing was seen there, but somebody or something may be, see HalfSeen and Walkers: not driven on, and neither remembered nor taken for motion
};

/// One map with the clearance of each of its cells. Only free cells are open; unknown is never free.
struct MapLayer {
  GridGeometry geometry;
  std::vector<CellState> state;
  std::vector<SurfaceOffset> surface;  ///< of cells that are not free; empty: in their middles
  std::vector<std::int16_t> squared;   ///< to the nearest cell that is not free, see TruncatedDistance
  int reach_cells = 0, units_per_cell = 1;
  /// What is taken off a clearance because the point and the surface lie anywhere in their cells [cells]: 0.5 and it is never too
  /// far; 0 and it is right in the mean.
  double surface_cells = 0.5;

  CellState at(int ix, int iy) const {
    return geometry.contains(ix, iy) ? state[geometry.index(ix, iy)] : CellState::kUnknown;
  }
  std::int16_t squared_at(int ix, int iy) const {
    return geometry.contains(ix, iy) ? squared[geometry.index(ix, iy)] : std::int16_t{0};
  }
  /// From the middle of a point's cell to the surface in the nearest cell that is not free [m]; at most about the layer's
  /// reach, 0 in cells that are not free and outside the map.
  double clearance_m(double x_m, double y_m) const {
    return clearance_of(squared_at(geometry.cell_x(x_m), geometry.cell_y(y_m)));
  }
  /// The same from the point itself, between the middles of the four cells round it.
  double smooth_clearance_m(double x_m, double y_m) const;
  double clearance_of(std::int16_t squared) const {
    return squared <= 0 ? 0.0 : (std::sqrt(static_cast<double>(squared)) / units_per_cell - surface_cells) * geometry.resolution_m;
  }
  /// Smallest `squared` whose clearance is at least this.
  int squared_for(double clearance_m) const;
  /// What `squared` is at most.
  int squared_cut() const { return (reach_cells + 1) * units_per_cell * (reach_cells + 1) * units_per_cell; }
};

}  // namespace knav
