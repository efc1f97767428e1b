#include "brin_benchmark/world_in_map.h"

#include <algorithm>
#include <cmath>

#include "core/distance_transform.h"

namespace knav {
namespace {

constexpr double kSpacing_m = 0.1;
constexpr double kAround_m = 6.0, kSquare_m = 3.0;
constexpr double kSeenFrom_m = 0.6;      ///< lower things may not be in the map
constexpr double kElsewhere_m = 0.25;    ///< farther from the map's walls than this a point is one that nobody saw
constexpr double kReach_m = 1.0, kReach_rad = 0.06;
constexpr double kDearness = 0.01;       ///< of shifting by a metre, per m^2 of misfit: along a corridor nothing says where
constexpr std::size_t kFewest = 40;

}  // namespace

WorldInMap::WorldInMap(const WorldConfig& world, const MapDirectory& map, const Pose2& T_world_map)
    : T_map_world_(T_world_map.inverse()), geometry_(map.occupancy.geometry) {
  std::vector<std::uint8_t> occupied(map.occupancy.value.size());
  for (std::size_t i = 0; i < occupied.size(); ++i) occupied[i] = map.occupancy.value[i] > 50;
  to_wall_m_ = euclidean_distance_m(geometry_, occupied);
  for (const Solid& solid : world.solids) {
    if (solid.top_m < kSeenFrom_m || solid.bottom_m > 0.3 || solid.material == Material::kGlass) continue;
    for (std::size_t i = 0; i < solid.corners.size(); ++i) {
      const Point2 a = solid.corners[i], b = solid.corners[(i + 1) % solid.corners.size()];
      const int steps = static_cast<int>(std::hypot(b.x_m - a.x_m, b.y_m - a.y_m) / kSpacing_m);
      for (int k = 0; k < steps; ++k) {
        const double share = (k + 0.5) / steps;
        walls_.push_back({a.x_m + share * (b.x_m - a.x_m), a.y_m + share * (b.y_m - a.y_m)});
      }
    }
  }
}

double WorldInMap::misfit(const std::vector<Point2>& walls, const Pose2& T_map_world) const {
  double sum = 0.0;
  for (const Point2& wall : walls) {
    const Point2 p = T_map_world * wall;
    const int ix = geometry_.cell_x(p.x_m), iy = geometry_.cell_y(p.y_m);
    const double d = geometry_.contains(ix, iy) ? static_cast<double>(to_wall_m_[geometry_.index(ix, iy)]) : kElsewhere_m;
    sum += std::min(d * d, kElsewhere_m * kElsewhere_m);
  }
  return sum / static_cast<double>(walls.size());
}

Pose2 WorldInMap::align(const Point2& around) const {
  std::vector<Point2> walls;
  for (const Point2& p : walls_) {
    if (std::hypot(p.x_m - around.x_m, p.y_m - around.y_m) < kAround_m) walls.push_back(p);
  }
  if (walls.size() < kFewest) return T_map_world_;
  // Moved in the building's frame, turned about the point.
  const Pose2 T_world_around{around.x_m, around.y_m, 0.0};
  const auto moved = [&](const Pose2& by) { return T_map_world_ * T_world_around * by * T_world_around.inverse(); };
  Pose2 middle, best;
  double least = misfit(walls, T_map_world_);
  double step_m = 0.1, step_rad = 0.02;
  for (double reach_m = kReach_m, reach_rad = kReach_rad; step_m > 0.005; reach_m = step_m, reach_rad = step_rad, step_m /= 4.0, step_rad /= 4.0) {
    for (double x = -reach_m; x <= reach_m + 1e-9; x += step_m) {
      for (double y = -reach_m; y <= reach_m + 1e-9; y += step_m) {
        for (double yaw = -reach_rad; yaw <= reach_rad + 1e-9; yaw += step_rad) {
          const Pose2 by{middle.x_m + x, middle.y_m + y, middle.yaw_rad + yaw};
          const double cost = misfit(walls, moved(by)) + kDearness * (by.x_m * by.x_m + by.y_m * by.y_m);
          if (cost >= least) continue;
          least = cost;
          best = by;
        }
      }
    }
    middle = best;
  }
  return moved(best);
}

const Pose2& WorldInMap::T_map_world(const Point2& in_world) const {
  const std::pair<int, int> square{static_cast<int>(std::floor(in_world.x_m / kSquare_m)), static_cast<int>(std::floor(in_world.y_m / kSquare_m))};
  const std::lock_guard<std::mutex> lock(mutex_);
  auto found = near_.find(square);
  if (found == near_.end()) {
    found = near_.emplace(square, align({(square.first + 0.5) * kSquare_m, (square.second + 0.5) * kSquare_m})).first;
  }
  return found->second;
}

}  // namespace knav
