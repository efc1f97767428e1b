#include "global_map_builder/map_occupancy.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace knav {
namespace {

constexpr double kShadow_cells = 2.0;  // between the true distance and that along the rays

void mark_surface(const Contour& contour, OccupancyGrid* grid) {
  const GridGeometry& g = grid->geometry;
  for (const Point2& p : sample_contour(contour, 0.25 * g.resolution_m)) {
    const int ix = g.cell_x(p.x_m), iy = g.cell_y(p.y_m);
    if (g.contains(ix, iy)) grid->value[g.index(ix, iy)] = 100;
  }
}

}  // namespace

void mark_driven(const GridGeometry& g, const Trajectory& trajectory, double radius_m,
                 std::vector<bool>* driven) {
  if (radius_m <= 0.0) return;
  Pose2 last;
  bool any = false;
  for (const StampedPose2& pose : trajectory) {
    const Pose2& T = pose.T_map_robot;
    if (any && distance_m(last, T) < 0.5 * g.resolution_m) continue;
    last = T;
    any = true;
    for (int iy = g.cell_y(T.y_m - radius_m); iy <= g.cell_y(T.y_m + radius_m); ++iy) {
      for (int ix = g.cell_x(T.x_m - radius_m); ix <= g.cell_x(T.x_m + radius_m); ++ix) {
        if (g.contains(ix, iy) &&
            std::hypot(g.center_x_m(ix) - T.x_m, g.center_y_m(iy) - T.y_m) <= radius_m) {
          (*driven)[g.index(ix, iy)] = true;
        }
      }
    }
  }
}

std::vector<bool> lone_holes(const GridGeometry& g, const std::vector<bool>& open, double rim_m) {
  std::vector<bool> holes(open.size(), false), visited(open.size(), false);
  const auto longest = static_cast<std::size_t>(std::max(0.0, rim_m / g.resolution_m + 1e-6));  // in sides of cells
  std::vector<std::size_t> piece;
  for (std::size_t first = 0; first < open.size(); ++first) {
    if (open[first] || visited[first]) continue;
    piece.assign(1, first);
    visited[first] = true;
    std::size_t rim = 0;
    bool at_edge = false;
    for (std::size_t next = 0; next < piece.size(); ++next) {
      const int ix = static_cast<int>(piece[next] % static_cast<std::size_t>(g.width_cells));
      const int iy = static_cast<int>(piece[next] / static_cast<std::size_t>(g.width_cells));
      for (const auto& [dx, dy] : {std::pair{1, 0}, std::pair{-1, 0}, std::pair{0, 1}, std::pair{0, -1}}) {
        if (!g.contains(ix + dx, iy + dy)) {
          at_edge = true;
          continue;
        }
        const std::size_t beside = g.index(ix + dx, iy + dy);
        if (open[beside]) {
          ++rim;
        } else if (!visited[beside]) {
          visited[beside] = true;
          piece.push_back(beside);
        }
      }
    }
    if (at_edge || rim > longest) continue;
    for (const std::size_t i : piece) holes[i] = true;
  }
  return holes;
}

OccupancyGrid occupancy_from_surface(const GridGeometry& geometry, const std::vector<float>& value_m,
                                     const std::vector<bool>& driven, const Contour& contour, double rim_m,
                                     std::vector<float>* distance_m) {
  const auto tolerance = static_cast<float>(kShadow_cells * geometry.resolution_m);
  // Behind a surface the distance along a ray is never less than the true one. Where the nearest surface is farther off,
  // rays passed on their way into another: the shadow of an edge, of which nothing is known. So where nothing was seen.
  const auto unseen = [&](std::size_t i) { return !((*distance_m)[i] <= tolerance - value_m[i]); };
  std::vector<bool> open(value_m.size());
  for (std::size_t i = 0; i < open.size(); ++i) open[i] = value_m[i] > 0.0f || (driven[i] && unseen(i));
  const std::vector<bool> hole = lone_holes(geometry, open, rim_m);
  OccupancyGrid occupancy;
  occupancy.geometry = geometry;
  occupancy.value.assign(value_m.size(), -1);
  for (std::size_t i = 0; i < value_m.size(); ++i) {
    float& d = (*distance_m)[i];
    if (open[i] || hole[i]) {
      occupancy.value[i] = 0;
    } else {
      d = unseen(i) ? std::numeric_limits<float>::quiet_NaN() : -d;
    }
  }
  mark_surface(contour, &occupancy);
  return occupancy;
}

}  // namespace knav
