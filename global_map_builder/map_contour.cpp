#include "global_map_builder/map_contour.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

namespace knav {
namespace {

/// Sides of a square of four cell centres: 0 lower, 1 right, 2 upper, 3 left. For each sign pattern (bit per
/// corner, set = positive; corners lower left, lower right, upper right, upper left) the sides a segment
/// joins.
struct SidePair {
  int first, second;
};
constexpr SidePair kNone{-1, -1};
constexpr SidePair kSides[16][2] = {{kNone, kNone},  {{3, 0}, kNone}, {{0, 1}, kNone}, {{3, 1}, kNone},
                                    {{1, 2}, kNone}, {kNone, kNone},  {{0, 2}, kNone}, {{3, 2}, kNone},
                                    {{2, 3}, kNone}, {{2, 0}, kNone}, {kNone, kNone},  {{2, 1}, kNone},
                                    {{1, 3}, kNone}, {{1, 0}, kNone}, {{0, 3}, kNone}, {kNone, kNone}};

/// The two segments of a saddle, by the sign at its middle.
void saddle(int pattern, bool middle_positive, SidePair out[2]) {
  const bool diagonal_positive =
      (pattern == 5) == middle_positive;  // do the segments cut off corners 1 and 3?
  out[0] = diagonal_positive ? SidePair{0, 1} : SidePair{3, 0};
  out[1] = diagonal_positive ? SidePair{2, 3} : SidePair{1, 2};
}

}  // namespace

Contour extract_zero_level(const GridGeometry& geometry, const std::vector<float>& value_m,
                           const std::vector<std::uint8_t>& measured) {
  Contour contour;
  for (int iy = 0; iy + 1 < geometry.height_cells; ++iy) {
    for (int ix = 0; ix + 1 < geometry.width_cells; ++ix) {
      const float v[4] = {value_m[geometry.index(ix, iy)], value_m[geometry.index(ix + 1, iy)],
                          value_m[geometry.index(ix + 1, iy + 1)], value_m[geometry.index(ix, iy + 1)]};
      int pattern = 0;
      bool known = true;
      for (int k = 0; k < 4; ++k) {
        known = known && !std::isnan(v[k]);
        if (v[k] > 0.0f) pattern |= 1 << k;
      }
      if (!known || pattern == 0 || pattern == 15) continue;
      SidePair pairs[2] = {kSides[pattern][0], kSides[pattern][1]};
      if (pattern == 5 || pattern == 10) saddle(pattern, v[0] + v[1] + v[2] + v[3] > 0.0f, pairs);
      const double x0 = geometry.center_x_m(ix), y0 = geometry.center_y_m(iy), side = geometry.resolution_m;
      const auto crossing = [&](int which) {
        const auto share = [&](int from, int to) { return v[from] / (v[from] - v[to]); };
        switch (which) {
          case 0:
            return Point2{x0 + side * static_cast<double>(share(0, 1)), y0};
          case 1:
            return Point2{x0 + side, y0 + side * static_cast<double>(share(1, 2))};
          case 2:
            return Point2{x0 + side * static_cast<double>(share(3, 2)), y0 + side};
          default:
            return Point2{x0, y0 + side * static_cast<double>(share(0, 3))};
        }
      };
      const std::size_t corner[4] = {geometry.index(ix, iy), geometry.index(ix + 1, iy),
                                     geometry.index(ix + 1, iy + 1), geometry.index(ix, iy + 1)};
      const auto seen = [&](int which) {  // side k joins corners k and k + 1
        return measured.empty() || measured[corner[which]] || measured[corner[(which + 1) % 4]];
      };
      for (const SidePair& pair : pairs) {
        if (pair.first >= 0 && seen(pair.first) && seen(pair.second))
          contour.push_back({crossing(pair.first), crossing(pair.second)});
      }
    }
  }
  return contour;
}

void remove_short_pieces(double min_length_m, Contour* contour) {
  std::vector<std::size_t> parent(contour->size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&parent](std::size_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  // Neighbours share a crossing, computed from the same two cells: the same number to the last few bits.
  std::map<std::pair<long long, long long>, std::size_t> at;
  for (std::size_t i = 0; i < contour->size(); ++i) {
    for (const Point2& p : {(*contour)[i].a, (*contour)[i].b}) {
      const auto key = std::make_pair(std::llround(p.x_m * 1e6), std::llround(p.y_m * 1e6));
      const auto [entry, added] = at.emplace(key, i);
      if (!added) parent[root(i)] = root(entry->second);
    }
  }
  std::vector<double> length(contour->size());
  const auto length_of = [](const ContourSegment& s) {
    return std::hypot(s.a.x_m - s.b.x_m, s.a.y_m - s.b.y_m);
  };
  for (std::size_t i = 0; i < contour->size(); ++i) length[root(i)] += length_of((*contour)[i]);
  Contour kept;
  for (std::size_t i = 0; i < contour->size(); ++i) {
    if (length[root(i)] >= min_length_m) kept.push_back((*contour)[i]);
  }
  *contour = std::move(kept);
}

std::vector<Point2> sample_contour(const Contour& contour, double step_m) {
  std::vector<Point2> points;
  for (const ContourSegment& s : contour) {
    const double length = std::hypot(s.b.x_m - s.a.x_m, s.b.y_m - s.a.y_m);
    const int count = std::max(1, static_cast<int>(std::ceil(length / step_m)));
    for (int k = 0; k < count; ++k) {
      const double t = (k + 0.5) / count;
      points.push_back({s.a.x_m + t * (s.b.x_m - s.a.x_m), s.a.y_m + t * (s.b.y_m - s.a.y_m)});
    }
  }
  return points;
}

double squared_distance(const ContourSegment& s, double x_m, double y_m) {
  const double ex = s.b.x_m - s.a.x_m, ey = s.b.y_m - s.a.y_m;
  const double px = x_m - s.a.x_m, py = y_m - s.a.y_m;
  const double square = ex * ex + ey * ey;
  const double t = square > 0.0 ? std::clamp((px * ex + py * ey) / square, 0.0, 1.0) : 0.0;
  const double dx = px - t * ex, dy = py - t * ey;
  return dx * dx + dy * dy;
}

}  // namespace knav
