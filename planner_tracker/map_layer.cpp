#include "planner_tracker/map_layer.h"

#include <algorithm>

namespace knav {

int MapLayer::squared_for(double clearance_m) const {
  const double units = (clearance_m / geometry.resolution_m + surface_cells) * units_per_cell;
  return std::max(1, static_cast<int>(std::ceil(units * units - 1e-9)));
}

double MapLayer::smooth_clearance_m(double x_m, double y_m) const {
  if (squared_at(geometry.cell_x(x_m), geometry.cell_y(y_m)) <= 0) return 0.0;
  const double x = (x_m - geometry.origin_x_m) / geometry.resolution_m - 0.5, y = (y_m - geometry.origin_y_m) / geometry.resolution_m - 0.5;
  const int ix = static_cast<int>(std::floor(x)), iy = static_cast<int>(std::floor(y));
  const double u = x - ix, v = y - iy;
  const auto at = [&](int dx, int dy) { return clearance_of(squared_at(ix + dx, iy + dy)); };
  return (1.0 - v) * ((1.0 - u) * at(0, 0) + u * at(1, 0)) + v * ((1.0 - u) * at(0, 1) + u * at(1, 1));
}

}  // namespace knav
