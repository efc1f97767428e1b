#include "kinect_calib/wall_plane.h"

#include <Eigen/Dense>

#include "kinect_calib/wall_tiles.h"

namespace knav {

int fit_wall_plane(const TileGrid& grid, const std::vector<double>& per_m, int enough, WallPlane* plane) {
  int kept = 0;
  for (const double tolerance : {0.2, 0.12, kWallShare, kWallShare}) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Identity() * 1e-9;
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    kept = 0;
    for (std::size_t tile = 0; tile < grid.count(); ++tile) {
      const double expected = plane->at(grid.x[tile], grid.y[tile]);
      if (!(std::abs(per_m[tile] - expected) <= wall_tolerance_per_m(tolerance, expected))) continue;
      const Eigen::Vector3d terms(grid.x[tile], grid.y[tile], 1.0);
      A += terms * terms.transpose();
      b += terms * per_m[tile];
      ++kept;
    }
    if (kept < enough) break;
    const Eigen::Vector3d solution = A.ldlt().solve(b);
    *plane = {solution[2], solution[0], solution[1]};
  }
  return kept;
}

}  // namespace knav
