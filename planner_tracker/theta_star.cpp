#include "planner_tracker/theta_star.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

namespace knav {

double theta_star_length_m(const MapLayer& layer, double clearance_m, const Point2& start,
                           const Point2& goal) {
  const GridGeometry& g = layer.geometry;
  const int hard = layer.squared_for(clearance_m);
  const auto open = [&](int ix, int iy) { return layer.squared_at(ix, iy) >= hard; };
  const auto sees = [&](int ax, int ay, int bx, int by) {
    const int steps = 2 * std::max(std::abs(bx - ax), std::abs(by - ay));
    for (int i = 0; i <= steps; ++i) {
      const double t = steps == 0 ? 0.0 : static_cast<double>(i) / steps;
      if (!open(static_cast<int>(std::lround(ax + t * (bx - ax))),
                static_cast<int>(std::lround(ay + t * (by - ay))))) {
        return false;
      }
    }
    return true;
  };
  const int width = g.width_cells;
  const int sx = g.cell_x(start.x_m), sy = g.cell_y(start.y_m), tx = g.cell_x(goal.x_m),
            ty = g.cell_y(goal.y_m);
  const double infinite = std::numeric_limits<double>::infinity();
  if (!open(sx, sy) || !open(tx, ty)) return infinite;
  std::vector<float> cost(g.cell_count(), std::numeric_limits<float>::infinity());
  std::vector<int> parent(g.cell_count(), -1);
  std::vector<bool> closed(g.cell_count());
  using Entry = std::pair<float, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> list;
  const auto between = [](int ax, int ay, int bx, int by) {
    return static_cast<float>(std::hypot(bx - ax, by - ay));
  };
  const int first = sy * width + sx;
  cost[g.index(sx, sy)] = 0.0f;
  parent[g.index(sx, sy)] = first;
  list.push({between(sx, sy, tx, ty), first});
  while (!list.empty()) {
    const int at = list.top().second;
    list.pop();
    if (closed[static_cast<std::size_t>(at)]) continue;
    closed[static_cast<std::size_t>(at)] = true;
    const int x = at % width, y = at / width;
    if (x == tx && y == ty) return cost[static_cast<std::size_t>(at)] * g.resolution_m;
    const int up = parent[static_cast<std::size_t>(at)];
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int nx = x + dx, ny = y + dy;
        if (!open(nx, ny) || closed[g.index(nx, ny)]) continue;
        int from = up;
        if (!sees(up % width, up / width, nx, ny)) from = at;
        const float next = cost[static_cast<std::size_t>(from)] + between(from % width, from / width, nx, ny);
        if (next >= cost[g.index(nx, ny)]) continue;
        cost[g.index(nx, ny)] = next;
        parent[g.index(nx, ny)] = from;
        list.push({next + between(nx, ny, tx, ty), ny * width + nx});
      }
    }
  }
  return infinite;
}

}  // namespace knav
