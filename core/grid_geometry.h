#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/pose2.h"

namespace knav {

/// Where a row-major grid lies in its frame, as nav_msgs/MapMetaData without rotation: (origin_x, origin_y) is the
/// lower left corner of cell (0, 0), whose centre lies half a cell further.
struct GridGeometry {
  int width_cells = 0;
  int height_cells = 0;
  double resolution_m = 0.05;
  double origin_x_m = 0.0;
  double origin_y_m = 0.0;

  std::size_t cell_count() const {
    return static_cast<std::size_t>(width_cells) * static_cast<std::size_t>(height_cells);
  }
  bool contains(int ix, int iy) const { return ix >= 0 && iy >= 0 && ix < width_cells && iy < height_cells; }
  std::size_t index(int ix, int iy) const {
    return static_cast<std::size_t>(iy) * static_cast<std::size_t>(width_cells) + static_cast<std::size_t>(ix);
  }
  int cell_x(double x_m) const { return static_cast<int>(std::floor((x_m - origin_x_m) / resolution_m)); }
  int cell_y(double y_m) const { return static_cast<int>(std::floor((y_m - origin_y_m) / resolution_m)); }
  double center_x_m(int ix) const { return origin_x_m + (ix + 0.5) * resolution_m; }
  double center_y_m(int iy) const { return origin_y_m + (iy + 0.5) * resolution_m; }
};

/// nav_msgs/OccupancyGrid's values: 0 free ... 100 occupied, -1 unknown.
struct OccupancyGrid {
  GridGeometry geometry;
  std::vector<std::int8_t> value;
};

}  // namespace knav
