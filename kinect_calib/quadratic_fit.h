#pragma once

#include <vector>

#include "kinect_calib/wall_measurement.h"
#include "kinect_calib/wall_tiles.h"

namespace knav {

/// The paper's model (section III.B): per tile D_k(u) = a u^2 + b u + c [m].
struct QuadraticField {
  std::vector<double> a_per_m, b, c_m;
  std::vector<char> filled;  ///< tiles taken from their neighbours: too few distances, or far off them all
  int held = 0;              ///< tiles whose curvature was held where the parabola would have bent back
};

/// Of each wall only its tilt is used beside the range finder's distance. Corrected depth rises with raw
/// depth from 0.3 to 26 m in every tile: where the free fit would bend back, its curvature is held at the
/// limit. A tile whose correction at the far end lies off all its neighbours' takes their mean. UserError if
/// no tile saw walls at distances a factor kLeastSpan apart.
QuadraticField fit_quadratics(const TileGrid& grid, double range_finder_sd_m, double sensor_sd_per_m,
                              const std::vector<WallMeasurement>& walls);

constexpr double kLeastSpan = 1.5;

}  // namespace knav
