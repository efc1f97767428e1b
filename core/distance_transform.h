#pragma once

#include <cstdint>
#include <vector>

#include "core/grid_geometry.h"

namespace knav {

/// Exact Euclidean distance [m] from every cell centre to the nearest occupied cell centre, in linear time
/// (Felzenszwalb and Huttenlocher, "Distance Transforms of Sampled Functions", 2012).
/// @param occupied one byte per cell, row-major, non-zero = occupied
/// @return one value per cell; +Inf everywhere if no cell is occupied
std::vector<float> euclidean_distance_m(const GridGeometry& geometry, const std::vector<std::uint8_t>& occupied);

}  // namespace knav
