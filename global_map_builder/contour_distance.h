#pragma once

#include <vector>

#include "core/grid_geometry.h"
#include "global_map_builder/map_contour.h"

namespace knav {

/// Distance [m] from every cell centre to the nearest point of the contour, wherever in its cell that lies.
///
/// A row-by-row Voronoi sweep (Breu, Gil, Kirkpatrick, Werman, "Linear Time Euclidean Distance Transform
/// Algorithms", 1995, extended from lattice points to points anywhere): sites above a row that own a part of
/// it are a subset of those that own a part of the row before plus the sites in between, because Voronoi
/// regions are convex. One sweep upward, one downward. Sites are points along the segments; the distance is
/// then taken to the owner's whole segment, so what sampling costs is below 1/50 of a cell beside a surface
/// and vanishes with distance. +Inf if the contour is empty. Time: cells + sites per row.
std::vector<float> contour_distance_m(const GridGeometry& geometry, const Contour& contour);

/// The paper's way (section III.G), slow: rays from every cell with F > 0 through F, cell by cell, to the
/// first crossing; the least distance is kept. NaN where F is not positive or nothing is met.
/// @param value_m F, NaN = unknown: a ray ends there with nothing
std::vector<float> ray_traced_distance_m(const GridGeometry& geometry, const std::vector<float>& value_m,
                                         int rays);

}  // namespace knav
