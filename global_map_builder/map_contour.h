#pragma once

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
/// @param value_m  one per cell, NaN = unknown
Contour extract_zero_level(const GridGeometry& geometry, const std::vector<float>& value_m);

/// Removes connected pieces whose length in all is less than `min_length_m`: lone noise.
void remove_short_pieces(double min_length_m, Contour* contour);

/// Points at even steps of at most `step_m` along the contour.
std::vector<Point2> sample_contour(const Contour& contour, double step_m);

double squared_distance(const ContourSegment& segment, double x_m, double y_m);

}  // namespace knav
