#pragma once

#include <vector>

#include "global_map_builder/map_directory.h"

namespace knav {

/// An area that is not as it was.
struct MapChange {
  bool occupied = false;                 ///< now; false: it became free
  double x_m = 0.0, y_m = 0.0;           ///< its middle, in the map
  double width_m = 0.0, height_m = 0.0;  ///< of the box round it, along x and y
  double wall_m = 0.0;                   ///< about the length of surface that came or went
};

/// Surfaces that came into what was known free, or went from what is now known free; the largest first. What
/// was or is unknown is no change, nor is a surface that lies within `tolerance_m` of where it was.
/// @param least_m shorter surfaces are noise
std::vector<MapChange> find_changes(const OccupancyGrid& before, const OccupancyGrid& now, double tolerance_m,
                                    double least_m);

}  // namespace knav
