#pragma once

#include <cstdint>

#include "core/tsdf_observation.h"

namespace knav {

/// From a row of cells to an observation's columns: the first part of equation 3.
struct TsdfRowProjection {
  float cos_yaw, sin_yaw;      ///< of the sensor
  float resolution, first_dx;  ///< dx of cell k, as seen from the sensor, is first_dx + resolution k [m]
  float dy;                    ///< [m]
  float column_scale, column_shift;
  int columns;
};

/// Which column of a pinhole's observation sees each of the cells [first, first + count) (-1: none), and how far from the
/// sensor they are [m]. Every target computes the same bytes.
void project_row_pinhole(const TsdfRowProjection& projection, int first, int count, std::int32_t* column,
                         float* distance_m);
/// The same for columns at equal angles.
/// @param angle_rad  scratch, `count` long
void project_row_angular(const TsdfRowProjection& projection, int first, int count, std::int32_t* column,
                         float* distance_m, float* angle_rad);

/// What an observation may see, by the directions of its view's edges: a column wider than it is.
class TsdfView {
 public:
  explicit TsdfView(const TsdfObservation& observation);

  /// The part [low, high] of the row at height dy over the sensor that lies within a distance and in the view; false:
  /// none.
  bool span(double dy_m, double within_m, double* low_m, double* high_m) const;

 private:
  bool all_round_, narrow_;
  double right_x_, right_y_, left_x_, left_y_;
};

}  // namespace knav
