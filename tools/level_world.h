#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

namespace knav {

/// A point of a surface with its normal, in the recording's own world.
struct SurfacePoint {
  Eigen::Vector3d position_m, normal;
};

/// Which way is up in a recording whose world is not aligned to gravity, and where its floor is.
struct LevelWorld {
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  double floor_m = 0.0;  ///< along up
  int level_points = 0;  ///< that lie on level surfaces
};

/// Floors and table tops are level: up is where their normals gather, searched from a first guess (the
/// cameras' own up) in cones that narrow. The floor is the lowest level surface with a fair share of the
/// points.
inline LevelWorld find_level(const std::vector<SurfacePoint>& points, const Eigen::Vector3d& guess) {
  LevelWorld level;
  level.up = guess.normalized();
  for (const double cone_deg : {45.0, 30.0, 20.0, 10.0, 10.0, 5.0, 5.0}) {
    const double cosine = std::cos(cone_deg * M_PI / 180.0);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const SurfacePoint& point : points) {
      if (point.normal.dot(level.up) > cosine) sum += point.normal;
    }
    if (sum.norm() > 0.0) level.up = sum.normalized();
  }
  constexpr double kBin_m = 0.02;
  std::map<int, double> histogram;
  for (const SurfacePoint& point : points) {
    if (point.normal.dot(level.up) < std::cos(12.0 * M_PI / 180.0)) continue;
    ++level.level_points;
    histogram[static_cast<int>(std::floor(point.position_m.dot(level.up) / kBin_m))] += 1.0;
  }
  const auto near = [&](int bin) {
    double count = 0.0;
    for (int i = bin - 1; i <= bin + 1; ++i) count += histogram.count(i) > 0 ? histogram.at(i) : 0.0;
    return count;
  };
  double most = 0.0;
  for (const auto& entry : histogram) most = std::max(most, near(entry.first));
  for (const auto& entry : histogram) {
    if (near(entry.first) < 0.15 * most) continue;
    // Climb to the top of this first heap.
    int bin = entry.first;
    while (near(bin + 1) > near(bin)) ++bin;
    double weighted = 0.0;
    for (int i = bin - 1; i <= bin + 1; ++i) {
      if (histogram.count(i) > 0) weighted += histogram.at(i) * (i + 0.5) * kBin_m;
    }
    level.floor_m = weighted / near(bin);
    break;
  }
  return level;
}

}  // namespace knav
