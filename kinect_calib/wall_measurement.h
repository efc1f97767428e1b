#pragma once

#include <cstddef>
#include <vector>

namespace knav {

/// What the frames of one wall distance say, per tile.
struct WallMeasurement {
  double distance_m = 0.0;  ///< as the range finder says
  int frames = 0;
  std::vector<double> sum_per_m, count;  ///< per tile: inverse depth, summed over frames
  /// The wall as fitted: 1 / z = (1 + range_error + tilt_x x + tilt_y y) / distance_m.
  double range_error = 0.0, tilt_x = 0.0, tilt_y = 0.0;

  bool has(std::size_t tile) const { return count[tile] > 0.0; }
  double measured_per_m(std::size_t tile) const { return sum_per_m[tile] / count[tile]; }
  /// By the range finder, with the wall's tilt.
  double true_per_m(double x, double y) const { return (1.0 + tilt_x * x + tilt_y * y) / distance_m; }
};

}  // namespace knav
