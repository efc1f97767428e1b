#pragma once

#include <cmath>
#include <vector>

#include "kinect_calib/kinect_noise.h"

namespace knav {

struct TileGrid;

/// A flat wall in the camera's eyes: inverse depth [1/m] is affine in the normalised image coordinates
/// (x right, y down).
struct WallPlane {
  double per_m = 0.0, per_m_x = 0.0, per_m_y = 0.0;

  double at(double x, double y) const { return per_m_x * x + per_m_y * y + per_m; }
  /// Along the optical axis.
  double distance_m() const { return 1.0 / per_m; }
  /// Positive: the camera looks to the left of the wall's normal.
  double yaw_rad() const { return std::atan2(per_m_x, per_m); }
  /// Positive: the camera looks up.
  double pitch_rad() const { return std::atan2(per_m_y, per_m); }
  /// Tangent of the angle off square, to any side.
  double tilt() const { return std::hypot(per_m_x, per_m_y) / per_m; }
};

/// How far a tile may lie off a wall's plane and still be the wall. What is an error in disparity is a larger
/// share of the inverse depth the farther the wall.
constexpr double wall_tolerance_per_m(double share, double expected_per_m) {
  return share * expected_per_m + 4.0 * kInverseDepthPerCode;
}
constexpr double kWallShare = 0.08;  ///< of the inverse depth, with the tilt known

/// Fits the plane that most tiles lie on, starting at *plane, less tolerant each time.
/// @param per_m   inverse depth of each tile of the grid, NaN where there is none
/// @param enough  tiles it must rest on
/// @return the tiles it rests on; below `enough` the plane is of no use
int fit_wall_plane(const TileGrid& grid, const std::vector<double>& per_m, int enough, WallPlane* plane);

}  // namespace knav
