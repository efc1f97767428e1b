#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/grid_geometry.h"
#include "core/pose2.h"

namespace knav {

/// A piece of a wall's surface, shorter than a cell's diagonal.
struct ContourSegment {
  Point2 a, b;
};
using Contour = std::vector<ContourSegment>;

/// The zero level of a signed distance sampled at cell centres, by marching squares with linear
/// interpolation; only where all four corners are known: positive next to unknown is no surface.
/// @param value_m   one per cell, NaN = unknown
/// @param measured  one per cell: readings ended there; a crossing counts where either of its two cells has it.
/// Empty: every crossing counts. Elsewhere the sign changes along the edge of a shadow too: free space beside what
/// a ray passed on its way into a surface.
Contour extract_zero_level(const GridGeometry& geometry, const std::vector<float>& value_m,
                           const std::vector<std::uint8_t>& measured = {});

/// Removes connected pieces whose length in all is less than `min_length_m`: lone noise.
void remove_short_pieces(double min_length_m, Contour* contour);

/// Points at even steps of at most `step_m` along the contour.
std::vector<Point2> sample_contour(const Contour& contour, double step_m);

double squared_distance(const ContourSegment& segment, double x_m, double y_m);

}  // namespace knav
