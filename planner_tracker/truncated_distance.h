#pragma once

#include <cstdint>
#include <vector>

namespace knav {

/// Cells [x0, x1) x [y0, y1).
struct CellWindow {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;

  bool empty() const { return x0 >= x1 || y0 >= y1; }
  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
  CellWindow grown(int cells) const { return {x0 - cells, y0 - cells, x1 + cells, y1 + cells}; }
  CellWindow clipped(int width, int height) const;
  /// The smallest window round both; an empty one adds nothing.
  CellWindow united(const CellWindow& other) const;
  void include(int ix, int iy);
};

/// Where in a blocked cell its surface is, from the cell's middle, in TruncatedDistance's units; at most half a cell.
struct SurfaceOffset {
  std::int8_t x = 0, y = 0;
  bool operator==(const SurfaceOffset& o) const { return x == o.x && y == o.y; }
  bool operator!=(const SurfaceOffset& o) const { return !(*this == o); }
};

/// Squared Euclidean distance from a cell's middle to the surface in the nearest blocked cell, cut at a reach. Exact where the surfaces
/// are in the cells' middles: the same numbers as core's euclidean_distance_m(), but of a window of a larger grid, on
/// 16-bit integers that the compiler vectorises: 14 ms instead of 82 ms for 3.7 million cells at a reach of 14
/// (benchmark_planner, without `surface`). With surfaces elsewhere in their cells, of each column of cells the one counts that is nearest along the
/// column: never too near, exact along walls, and among lone surfaces too far by a cell at most.
class TruncatedDistance {
 public:
  /// @param units_per_cell  of distances and offsets; (reach + 1) times this is at most 127
  explicit TruncatedDistance(int reach_cells, int units_per_cell = 1);
  /// The finest units for a reach, 8 to the cell at most.
  static int finest_units(int reach_cells);

  int reach_cells() const { return reach_; }
  int units_per_cell() const { return units_; }
  /// What is farther has this value, the square of a cell more than the reach.
  std::int16_t cut() const { return cut_; }

  /// Recomputes `squared` in the window, which is clipped to the grid. What lies off the grid counts as
  /// blocked.
  /// @param cells [width x height], row-major; every value but `open` is blocked
  /// @param surface  of the blocked cells, the same shape; null: their middles
  /// @param squared  [units^2], 0 in blocked cells
  void update(int width, int height, const std::uint8_t* cells, std::uint8_t open, const SurfaceOffset* surface,
              const CellWindow& window, std::int16_t* squared);

 private:
  struct Sweep;
  void nearest_along_columns(const Sweep& sweep);
  void nearest_along_rows(const Sweep& sweep, std::int16_t* squared);

  int reach_, units_;
  std::int16_t cut_;
  std::vector<std::int16_t> rows_;   ///< scratch, per cell: distance to the nearest surface of its column, then its square
  std::vector<std::int16_t> aside_;  ///< scratch, per cell: how far to the right of the column's middle that surface is
  std::vector<std::int16_t> run_, run_aside_;  ///< scratch: the sweep's current row
};

}  // namespace knav
