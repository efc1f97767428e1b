#pragma once

#include <vector>

#include "core/distance_map.h"
#include "core/grid_geometry.h"
#include "core/trajectory.h"
#include "global_map_builder/map_contour.h"

namespace knav {

/// The cells whose centres lie within `radius_m` of the robot's way.
void mark_driven(const GridGeometry& geometry, const Trajectory& trajectory, double radius_m,
                 std::vector<bool>* driven);

/// Holes in free space whose rim is shorter than `rim_m`: not seen, or behind a piece of contour so short that it was
/// taken for noise (remove_short_pieces()). What surrounds them says what they are, and a single such cell in a door
/// closes it to a planner that does not drive into the unknown.
/// @param open  per cell: seen free, or driven on
std::vector<bool> lone_holes(const GridGeometry& geometry, const std::vector<bool>& open, double rim_m);

/// Free (0): seen free, or driven on and not seen to be anything else, or a lone hole. Occupied (100): the contour runs through it. Else -1.
/// @param value_m     signed distance [m] a cell, NaN = unknown
/// @param distance_m  of each cell to the contour [m], unsigned; becomes signed, NaN where unknown
OccupancyGrid occupancy_from_surface(const GridGeometry& geometry, const std::vector<float>& value_m,
                                     const std::vector<bool>& driven, const Contour& contour, double rim_m,
                                     std::vector<float>* distance_m);

}  // namespace knav
