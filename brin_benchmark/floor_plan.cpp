#include "brin_benchmark/floor_plan.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "kinect_sim/collision_map.h"
#include "planner_tracker/planner_tracker_config.h"

namespace knav {
namespace {

constexpr double kCell_m = 0.05;
constexpr double kReach_m = 1.5;
constexpr double kSpare_m = 0.07;
constexpr double kRobotHeight_m = 1.2;
constexpr double kRing_m = 0.5;
constexpr int kCoarse = 4;  // cells between the points of reachable()

/// A careful driver's ways: more room than the robot itself would ask for.
PlannerTrackerConfig careful(double robot_radius_m) {
  PlannerTrackerConfig config;
  config.robot_radius = robot_radius_m;
  config.clearance.hard_m = kSpare_m;
  config.clearance.preferred_m = 0.5;
  config.clearance.price = 4.0;
  return config;
}

OccupancyGrid occupancy_of(const WorldConfig& world) {
  OccupancyGrid grid;
  GridGeometry& g = grid.geometry;
  g.resolution_m = kCell_m;
  g.origin_x_m = world.bounds.min_x_m;
  g.origin_y_m = world.bounds.min_y_m;
  const double width_m = world.bounds.max_x_m - world.bounds.min_x_m;
  const double height_m = world.bounds.max_y_m - world.bounds.min_y_m;
  if (!(std::max(width_m, height_m) < 1000.0)) throw UserError(world.file + ": is larger than 1 km.");
  g.width_cells = std::max(1, static_cast<int>(std::ceil(width_m / kCell_m)));
  g.height_cells = std::max(1, static_cast<int>(std::ceil(height_m / kCell_m)));
  grid.value.assign(g.cell_count(), 0);
  const CollisionMap obstacles(world, kRobotHeight_m);
  for (int iy = 0; iy < g.height_cells; ++iy) {
    for (int ix = 0; ix < g.width_cells; ++ix) {
      const Point2 p{g.center_x_m(ix), g.center_y_m(iy)};
      const bool rim = ix == 0 || iy == 0 || ix + 1 == g.width_cells || iy + 1 == g.height_cells;
      if (rim || obstacles.clearance_m(p) < 0.5 * kCell_m || obstacles.stairs_distance_m(p) < 0.10) {
        grid.value[g.index(ix, iy)] = 100;
      }
    }
  }
  return grid;
}

}  // namespace

FloorPlan::FloorPlan(const WorldConfig& world, double robot_radius_m)
    : robot_radius_m_(robot_radius_m),
      start_{world.spawn.x_m, world.spawn.y_m},
      map_(kReach_m, 65, 25, 0.0, 0.5),
      planner_(careful(robot_radius_m)) {
  map_.set_global({}, occupancy_of(world), {});
  planner_.set_map(map_.global());
}

std::vector<Point2> FloorPlan::path(const Point2& from, const Point2& to) const {
  PlanResult result;
  planner_.plan(map_.global(), from, to, &result);
  return result.code == PlanCode::kOk ? result.path : std::vector<Point2>{};
}

std::vector<char> FloorPlan::open_cells(double clearance_m) const {
  std::vector<char> open(map_.global().geometry.cell_count(), 0);
  for (std::size_t i = 0; i < open.size(); ++i) {
    open[i] = map_.global().clearance_of(map_.global().squared[i]) >= clearance_m;
  }
  return open;
}

std::vector<char> FloorPlan::flood(const std::vector<Solid>& added, double clearance_m) const {
  const GridGeometry& g = map_.global().geometry;
  std::vector<char> open = open_cells(clearance_m), seen(g.cell_count(), 0);
  // What is added is rounded up to whole cells, as the building itself is.
  const double away_m = clearance_m + 1.5 * kCell_m;
  for (const Solid& solid : added) {
    double low_x = 1e9, low_y = 1e9, high_x = -1e9, high_y = -1e9;
    for (const Point2& c : solid.corners) {
      low_x = std::min(low_x, c.x_m - away_m);
      high_x = std::max(high_x, c.x_m + away_m);
      low_y = std::min(low_y, c.y_m - away_m);
      high_y = std::max(high_y, c.y_m + away_m);
    }
    for (int iy = std::max(0, g.cell_y(low_y)); iy <= std::min(g.height_cells - 1, g.cell_y(high_y)); ++iy) {
      for (int ix = std::max(0, g.cell_x(low_x)); ix <= std::min(g.width_cells - 1, g.cell_x(high_x)); ++ix) {
        if (footprint_distance_m(solid, {g.center_x_m(ix), g.center_y_m(iy)}) < away_m)
          open[g.index(ix, iy)] = 0;
      }
    }
  }
  std::vector<std::size_t> found;
  flood_from(g.cell_x(start_.x_m), g.cell_y(start_.y_m), open, &seen, &found);
  return seen;
}

/// Marks in `seen` all open cells connected with this one that were not, and lists them.
void FloorPlan::flood_from(int ix, int iy, const std::vector<char>& open, std::vector<char>* seen,
                           std::vector<std::size_t>* found) const {
  const GridGeometry& g = map_.global().geometry;
  found->clear();
  const auto visit = [&](int x, int y) {
    if (!g.contains(x, y)) return;
    const std::size_t i = g.index(x, y);
    if (!open[i] || (*seen)[i]) return;
    (*seen)[i] = 1;
    found->push_back(i);
  };
  visit(ix, iy);
  const auto width = static_cast<std::size_t>(g.width_cells);
  for (std::size_t k = 0; k < found->size(); ++k) {
    const int x = static_cast<int>((*found)[k] % width), y = static_cast<int>((*found)[k] / width);
    visit(x + 1, y);
    visit(x - 1, y);
    visit(x, y + 1);
    visit(x, y - 1);
  }
}

/// The ground round the building: a world's bounds leave a metre of it on all sides.
std::vector<char> FloorPlan::outside(const std::vector<char>& open) const {
  const GridGeometry& g = map_.global().geometry;
  std::vector<char> seen(g.cell_count(), 0);
  std::vector<std::size_t> found;
  const int cells = static_cast<int>(kRing_m / kCell_m);
  for (const int ix : {cells, g.width_cells - 1 - cells}) {
    for (const int iy : {cells, g.height_cells - 1 - cells}) flood_from(ix, iy, open, &seen, &found);
  }
  return seen;
}

bool FloorPlan::starts_inside() const {
  const GridGeometry& g = map_.global().geometry;
  const std::vector<char> open = open_cells(robot_radius_m_ + kSpare_m);
  const int ix = g.cell_x(start_.x_m), iy = g.cell_y(start_.y_m);
  return g.contains(ix, iy) && open[g.index(ix, iy)] && !outside(open)[g.index(ix, iy)];
}

std::optional<Point2> FloorPlan::start_inside() const {
  const GridGeometry& g = map_.global().geometry;
  const std::vector<char> open = open_cells(robot_radius_m_ + kSpare_m);
  std::vector<char> seen = outside(open);
  std::vector<std::size_t> part, largest;
  for (int iy = 0; iy < g.height_cells; ++iy) {
    for (int ix = 0; ix < g.width_cells; ++ix) {
      if (!open[g.index(ix, iy)] || seen[g.index(ix, iy)]) continue;
      flood_from(ix, iy, open, &seen, &part);
      if (part.size() > largest.size()) largest.swap(part);
    }
  }
  if (largest.empty()) return std::nullopt;
  const auto roomier = [&](std::size_t a, std::size_t b) {
    return map_.global().squared[a] < map_.global().squared[b];
  };
  const std::size_t best = *std::max_element(largest.begin(), largest.end(), roomier);
  const auto width = static_cast<std::size_t>(g.width_cells);
  return Point2{g.center_x_m(static_cast<int>(best % width)), g.center_y_m(static_cast<int>(best / width))};
}

bool FloorPlan::connected(const std::vector<Point2>& points, const std::vector<Solid>& added) const {
  const GridGeometry& g = map_.global().geometry;
  const std::vector<char> seen = flood(added, robot_radius_m_ + kSpare_m);
  return std::all_of(points.begin(), points.end(), [&](const Point2& p) {
    const int ix = g.cell_x(p.x_m), iy = g.cell_y(p.y_m);
    return g.contains(ix, iy) && seen[g.index(ix, iy)];
  });
}

std::vector<Point2> FloorPlan::reachable(double clearance_m, const std::vector<Solid>& added) const {
  const GridGeometry& g = map_.global().geometry;
  const std::vector<char> seen = flood(added, robot_radius_m_ + kSpare_m);
  std::vector<Point2> points;
  for (int iy = 0; iy < g.height_cells; iy += kCoarse) {
    for (int ix = 0; ix < g.width_cells; ix += kCoarse) {
      const Point2 p{g.center_x_m(ix), g.center_y_m(iy)};
      if (seen[g.index(ix, iy)] && this->clearance_m(p) >= clearance_m) points.push_back(p);
    }
  }
  return points;
}

double length_m(const std::vector<Point2>& path) {
  double length = 0.0;
  for (std::size_t i = 1; i < path.size(); ++i) {
    length += std::hypot(path[i].x_m - path[i - 1].x_m, path[i].y_m - path[i - 1].y_m);
  }
  return length;
}

Point2 point_along(const std::vector<Point2>& path, double along_m) {
  for (std::size_t i = 1; i < path.size(); ++i) {
    const double dx = path[i].x_m - path[i - 1].x_m, dy = path[i].y_m - path[i - 1].y_m;
    const double step = std::hypot(dx, dy);
    if (along_m <= step && step > 0.0)
      return {path[i - 1].x_m + dx * along_m / step, path[i - 1].y_m + dy * along_m / step};
    along_m -= step;
  }
  return path.empty() ? Point2{} : path.back();
}

}  // namespace knav
