#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/grid_geometry.h"
#include "core/pose2.h"
#include "global_map_builder/dense_tsdf.h"

namespace knav {

/// A wall's surface point with the direction that faces the open.
struct SurfacePoint {
  float x_m, y_m, normal_x, normal_y;
};

/// What the robot saw round one keyframe, in the keyframe's frame: points to lay on another submap, and a
/// signed distance field to lay another's points on.
class Submap {
 public:
  /// Observations with poses relative to the keyframe (T_keyframe_sensor in T_map_sensor).
  Submap(const SurfaceConfig& surface, const std::vector<TsdfObservation>& observations);

  const std::vector<SurfacePoint>& points() const { return points_; }
  const GridGeometry& geometry() const { return geometry_; }
  bool empty() const { return points_.empty(); }

  /// Distance [m] to the surface in the cell of a point, `far` outside; never-seen cells count as behind
  /// (negative).
  float nearest(float x_m, float y_m, float far) const {
    const int ix = geometry_.cell_x(x_m), iy = geometry_.cell_y(y_m);
    return geometry_.contains(ix, iy) ? signed_m_[geometry_.index(ix, iy)] : far;
  }
  bool known(float x_m, float y_m) const {
    const int ix = geometry_.cell_x(x_m), iy = geometry_.cell_y(y_m);
    return geometry_.contains(ix, iy) && known_[geometry_.index(ix, iy)] != 0;
  }
  /// Bilinear between cell centres, with its gradient (pointing into the open); false outside.
  bool interpolate(double x_m, double y_m, double* distance_m, Eigen::Vector2d* gradient) const;

 private:
  GridGeometry geometry_;
  std::vector<float> signed_m_;
  std::vector<std::uint8_t> known_;
  std::vector<SurfacePoint> points_;
};

/// A grid in multiples of the resolution that holds all that the observations touch.
GridGeometry geometry_for(double resolution_m, const std::vector<TsdfObservation>& observations);

}  // namespace knav
