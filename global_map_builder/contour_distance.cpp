#include "global_map_builder/contour_distance.h"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>

namespace knav {
namespace {

/// A point of the contour in cells, y counted in the direction of the sweep; cell centres have whole numbers.
struct Site {
  double x, y;
  std::uint32_t segment;
};

constexpr int kSitesPerSegment = 4;

std::vector<Site> sites_of(const GridGeometry& g, const Contour& contour, bool upward) {
  std::vector<Site> sites;
  sites.reserve(contour.size() * kSitesPerSegment);
  for (std::size_t i = 0; i < contour.size(); ++i) {
    const ContourSegment& s = contour[i];
    for (int k = 0; k < kSitesPerSegment; ++k) {
      const double t = k / (kSitesPerSegment - 1.0);
      const double x = (s.a.x_m + t * (s.b.x_m - s.a.x_m) - g.origin_x_m) / g.resolution_m - 0.5;
      const double y = (s.a.y_m + t * (s.b.y_m - s.a.y_m) - g.origin_y_m) / g.resolution_m - 0.5;
      sites.push_back({x, upward ? y : g.height_cells - 1 - y, static_cast<std::uint32_t>(i)});
    }
  }
  // By the first row that lies at or beyond the site, then by x.
  std::sort(sites.begin(), sites.end(), [](const Site& p, const Site& q) {
    const double rp = std::ceil(p.y), rq = std::ceil(q.y);
    return rp != rq ? rp < rq : p.x != q.x ? p.x < q.x : p.y != q.y ? p.y > q.y : p.segment < q.segment;
  });
  return sites;
}

/// Where two sites' parabolas over the row meet; p left of q.
double border(const Site& p, const Site& q, double row) {
  const double hp = row - p.y, hq = row - q.y;
  return 0.5 * ((q.x * q.x + hq * hq) - (p.x * p.x + hp * hp)) / (q.x - p.x);
}

/// Keeps of `sites` (sorted by x) those that own a part of the row between x = low and high; `from[i]` is
/// where the part of the i-th begins.
void keep_owners(const std::vector<Site>& sites, double row, double low, double high,
                 std::vector<Site>* owners, std::vector<double>* from) {
  owners->clear();
  from->clear();
  for (const Site& site : sites) {
    double begin = low;
    bool owns = true;
    while (!owners->empty()) {
      const Site& last = owners->back();
      if (site.x <= last.x) {  // the same x: the nearer of the two remains
        if (row - site.y >= row - last.y) {
          owns = false;
          break;
        }
      } else {
        begin = border(last, site, row);
        if (begin > from->back()) break;
      }
      owners->pop_back();
      from->pop_back();
      begin = low;
    }
    if (!owns || begin > high) continue;
    owners->push_back(site);
    from->push_back(begin);
  }
}

/// Distances to the sites at or before each row, in the sweep's direction.
void sweep(const GridGeometry& g, const Contour& contour, bool upward, std::vector<float>* squared) {
  const std::vector<Site> sites = sites_of(g, contour, upward);
  squared->assign(g.cell_count(), std::numeric_limits<float>::infinity());
  std::vector<Site> owners, candidates;
  std::vector<double> from;
  std::size_t next = 0;
  const double low = 0.0, high = g.width_cells - 1, near2 = 9.0 * g.resolution_m * g.resolution_m;
  for (int row = 0; row < g.height_cells; ++row) {
    std::size_t end = next;
    while (end < sites.size() && sites[end].y <= row) ++end;
    candidates.clear();
    const auto by_x = [](const Site& p, const Site& q) { return p.x < q.x; };
    // Rows below the grid feed the first row; their sites are sorted by x row by row only.
    std::vector<Site> fresh(sites.begin() + static_cast<std::ptrdiff_t>(next),
                            sites.begin() + static_cast<std::ptrdiff_t>(end));
    if (row == 0) std::stable_sort(fresh.begin(), fresh.end(), by_x);
    next = end;
    std::merge(owners.begin(), owners.end(), fresh.begin(), fresh.end(), std::back_inserter(candidates),
               by_x);
    keep_owners(candidates, row, low, high, &owners, &from);
    if (owners.empty()) continue;
    const int iy = upward ? row : g.height_cells - 1 - row;
    const double y_m = g.center_y_m(iy);
    std::size_t owner = 0;
    for (int ix = 0; ix < g.width_cells; ++ix) {
      while (owner + 1 < owners.size() && from[owner + 1] <= ix) ++owner;
      const double x_m = g.center_x_m(ix);
      double best = squared_distance(contour[owners[owner].segment], x_m, y_m);
      if (best < near2) {  // so near, a neighbour's segment may be nearer though its sites are not
        if (owner > 0) best = std::min(best, squared_distance(contour[owners[owner - 1].segment], x_m, y_m));
        if (owner + 1 < owners.size()) {
          best = std::min(best, squared_distance(contour[owners[owner + 1].segment], x_m, y_m));
        }
      }
      (*squared)[g.index(ix, iy)] = static_cast<float>(best);
    }
  }
}

}  // namespace

std::vector<float> contour_distance_m(const GridGeometry& geometry, const Contour& contour) {
  std::vector<float> up, down;
  tbb::parallel_invoke([&] { sweep(geometry, contour, true, &up); },
                       [&] { sweep(geometry, contour, false, &down); });
  for (std::size_t i = 0; i < up.size(); ++i) up[i] = std::sqrt(std::min(up[i], down[i]));
  return up;
}

std::vector<float> ray_traced_distance_m(const GridGeometry& g, const std::vector<float>& value_m, int rays) {
  std::vector<float> distance(g.cell_count(), std::numeric_limits<float>::quiet_NaN());
  // F between cell centres, NaN next to unknown.
  const auto value_at = [&](double x, double y) {
    const int ix = static_cast<int>(std::floor(x)), iy = static_cast<int>(std::floor(y));
    if (ix < 0 || iy < 0 || ix + 1 >= g.width_cells || iy + 1 >= g.height_cells) return std::nan("");
    const double tx = x - ix, ty = y - iy;
    const float* v = &value_m[g.index(ix, iy)];
    return (1 - ty) * ((1 - tx) * v[0] + tx * v[1]) +
           ty * ((1 - tx) * v[g.width_cells] + tx * v[g.width_cells + 1]);
  };
  constexpr double kStep = 0.25;  // cells; no cell on the ray is skipped
  for (int iy = 0; iy < g.height_cells; ++iy) {
    for (int ix = 0; ix < g.width_cells; ++ix) {
      float& best = distance[g.index(ix, iy)];
      if (!(value_m[g.index(ix, iy)] > 0.0f)) continue;
      for (int ray = 0; ray < rays; ++ray) {
        const double angle = 2.0 * kPi * ray / rays, c = std::cos(angle), s = std::sin(angle);
        double before = value_m[g.index(ix, iy)];
        for (double r = kStep; !(best * (1.0 / g.resolution_m) < r - kStep); r += kStep) {
          const double value = value_at(ix + r * c, iy + r * s);
          if (std::isnan(value)) break;
          if (value <= 0.0) {
            const double crossing = (r - kStep + kStep * before / (before - value)) * g.resolution_m;
            if (!(best <= crossing)) best = static_cast<float>(crossing);
            break;
          }
          before = value;
        }
      }
    }
  }
  return distance;
}

}  // namespace knav
