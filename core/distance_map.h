#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "core/grid_geometry.h"

namespace knav {

/// The global map: the true signed distance [m] to the nearest wall contour, sampled at cell centres; positive in
/// the open, negative behind a surface, NaN where nothing is known (paper section III.G).
struct DistanceMap {
  GridGeometry geometry;
  std::vector<float> distance_m;
  std::string checksum;  ///< of the map directory; empty if it came from elsewhere

  bool empty() const { return distance_m.empty(); }
  /// NaN outside the grid and where unknown.
  float at(int ix, int iy) const {
    return geometry.contains(ix, iy) ? distance_m[geometry.index(ix, iy)] : std::numeric_limits<float>::quiet_NaN();
  }
  float nearest(double x_m, double y_m) const { return at(geometry.cell_x(x_m), geometry.cell_y(y_m)); }
};

}  // namespace knav
