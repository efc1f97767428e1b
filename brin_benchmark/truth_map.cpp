#include "brin_benchmark/truth_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/distance_transform.h"
#include "kinect_sim/map_evaluation.h"

namespace knav {
namespace {

constexpr double kCell_m = 0.05;
constexpr double kLow_m = 0.05, kHigh_m = 2.0;  // the slice that depth profiles are made of
constexpr double kExact_m = 1.0;
constexpr float kBehind_m = 0.3f;  // known this far into what bounds the free space
constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

bool inside(const Solid& solid, const Point2& p) {
  for (std::size_t i = 0; i < solid.corners.size(); ++i) {
    const Point2 &a = solid.corners[i], &b = solid.corners[(i + 1) % solid.corners.size()];
    if ((b.x_m - a.x_m) * (p.y_m - a.y_m) - (b.y_m - a.y_m) * (p.x_m - a.x_m) < 0.0) return false;
  }
  return true;
}

std::vector<std::uint8_t> filled(const GridGeometry& grid, const std::vector<Solid>& solids) {
  std::vector<std::uint8_t> occupied(grid.cell_count(), 0);
  for (const Solid& solid : solids) {
    double low_x = 1e9, low_y = 1e9, high_x = -1e9, high_y = -1e9;
    for (const Point2& c : solid.corners) {
      low_x = std::min(low_x, c.x_m);
      high_x = std::max(high_x, c.x_m);
      low_y = std::min(low_y, c.y_m);
      high_y = std::max(high_y, c.y_m);
    }
    for (int iy = std::max(0, grid.cell_y(low_y)); iy <= std::min(grid.height_cells - 1, grid.cell_y(high_y)); ++iy) {
      for (int ix = std::max(0, grid.cell_x(low_x)); ix <= std::min(grid.width_cells - 1, grid.cell_x(high_x)); ++ix) {
        if (inside(solid, {grid.center_x_m(ix), grid.center_y_m(iy)})) occupied[grid.index(ix, iy)] = 1;
      }
    }
  }
  return occupied;
}

/// Cells that are connected with the start through cells that are not occupied.
std::vector<std::uint8_t> reached(const GridGeometry& grid, const std::vector<std::uint8_t>& occupied, const Pose2& start) {
  std::vector<std::uint8_t> seen(grid.cell_count(), 0);
  std::vector<std::pair<int, int>> open{{grid.cell_x(start.x_m), grid.cell_y(start.y_m)}};
  while (!open.empty()) {
    const auto [ix, iy] = open.back();
    open.pop_back();
    if (!grid.contains(ix, iy) || occupied[grid.index(ix, iy)] || seen[grid.index(ix, iy)]) continue;
    seen[grid.index(ix, iy)] = 1;
    open.insert(open.end(), {{ix + 1, iy}, {ix - 1, iy}, {ix, iy + 1}, {ix, iy - 1}});
  }
  return seen;
}

}  // namespace

DistanceMap truth_map(const WorldConfig& world) {
  const TrueSurfaces surfaces(world, kLow_m, kHigh_m);
  DistanceMap map;
  GridGeometry& grid = map.geometry;
  grid.resolution_m = kCell_m;
  grid.origin_x_m = world.bounds.min_x_m;
  grid.origin_y_m = world.bounds.min_y_m;
  grid.width_cells = static_cast<int>(std::ceil((world.bounds.max_x_m - world.bounds.min_x_m) / kCell_m));
  grid.height_cells = static_cast<int>(std::ceil((world.bounds.max_y_m - world.bounds.min_y_m) / kCell_m));
  const std::vector<std::uint8_t> occupied = filled(grid, surfaces.solids());
  const std::vector<std::uint8_t> free = reached(grid, occupied, world.spawn);
  const std::vector<float> to_occupied_m = euclidean_distance_m(grid, occupied);
  const std::vector<float> to_free_m = euclidean_distance_m(grid, free);
  map.distance_m.assign(grid.cell_count(), kUnknown);
  for (int iy = 0; iy < grid.height_cells; ++iy) {
    for (int ix = 0; ix < grid.width_cells; ++ix) {
      const std::size_t i = grid.index(ix, iy);
      if (to_free_m[i] > kBehind_m) continue;
      const Point2 p{grid.center_x_m(ix), grid.center_y_m(iy)};
      Point2 on_surface;
      double distance_m = free[i] ? std::max(kExact_m, static_cast<double>(to_occupied_m[i])) : 0.0;
      if ((free[i] == 0 || to_occupied_m[i] < kExact_m + 2.0 * kCell_m) && surfaces.nearest(p, kExact_m, &on_surface)) {
        distance_m = std::hypot(p.x_m - on_surface.x_m, p.y_m - on_surface.y_m);
      }
      // Inside, edges that two solids share are no surface: never less than what the free cells say.
      if (!free[i]) distance_m = -std::max(std::min(distance_m, kExact_m), to_free_m[i] - 0.7 * kCell_m);
      map.distance_m[i] = static_cast<float>(distance_m);
    }
  }
  return map;
}

MapDirectory truth_map_directory(const WorldConfig& world) {
  MapDirectory map;
  map.distance = truth_map(world);
  map.occupancy.geometry = map.keepout.geometry = map.distance.geometry;
  map.keepout.value.assign(map.distance.distance_m.size(), 0);
  for (const float distance_m : map.distance.distance_m) {
    map.occupancy.value.push_back(std::isnan(distance_m) ? -1 : (distance_m < 0.5 * kCell_m ? 100 : 0));
  }
  map.about["made_from"] = "the walls and furniture of " + world.name;
  return map;
}

}  // namespace knav
