#include "planner_tracker/path_shortener.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace knav {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
/// A line this little dearer still replaces a crooked way: costs are sampled cell by cell.
constexpr double kTolerance = 1.002;

double length_m(const Point2& a, const Point2& b) { return std::hypot(b.x_m - a.x_m, b.y_m - a.y_m); }

}  // namespace

double PathShortener::segment_cost_m(const MapLayer& layer, const ClearancePrice& price, const Point2& from,
                                     const Point2& to) const {
  const GridGeometry& g = layer.geometry;
  const double length = length_m(from, to);
  const int steps = std::max(1, static_cast<int>(std::ceil(length / g.resolution_m)));
  const double dx = (to.x_m - from.x_m) / steps / g.resolution_m,
               dy = (to.y_m - from.y_m) / steps / g.resolution_m;
  double x = (from.x_m - g.origin_x_m) / g.resolution_m, y = (from.y_m - g.origin_y_m) / g.resolution_m;
  std::uint64_t sum = 0;
  for (int i = 0; i <= steps; ++i, x += dx, y += dy) {
    const int ix = static_cast<int>(std::floor(x)), iy = static_cast<int>(std::floor(y));
    const std::uint32_t factor = price.of(layer.squared_at(ix, iy));
    if (factor == 0) return kInfinite;
    sum += i == 0 || i == steps ? factor : 2 * factor;
  }
  return length * static_cast<double>(sum) / (512.0 * steps);
}

void PathShortener::pull(const MapLayer& layer, const ClearancePrice& price, std::vector<Point2>* points) {
  const std::size_t n = points->size();
  if (n < 3) return;
  const std::vector<Point2>& p = *points;
  cost_m_.resize(n);
  cost_m_[0] = 0.0;
  for (std::size_t i = 1; i < n; ++i) {
    const double cost = segment_cost_m(layer, price, p[i - 1], p[i]);
    // A step between nodes may graze a closed cell that a finer sampling meets; it is replaced at any price.
    cost_m_[i] = cost_m_[i - 1] + (std::isfinite(cost) ? cost : 10.0 * length_m(p[i - 1], p[i]));
  }
  const auto straight = [&](std::size_t i, std::size_t j) {
    return segment_cost_m(layer, price, p[i], p[j]) <= kTolerance * (cost_m_[j] - cost_m_[i]);
  };
  kept_.clear();
  kept_.push_back(p[0]);
  for (std::size_t i = 0; i + 1 < n;) {
    // Doubling, then halving: the farthest point in reach, near enough.
    std::size_t good = i + 1, step = 1, bad = n;
    while (good + step < n) {
      if (!straight(i, good + step)) {
        bad = good + step;
        break;
      }
      good += step;
      step *= 2;
    }
    if (bad == n && good + 1 < n) {
      if (straight(i, n - 1))
        good = n - 1;
      else
        bad = n - 1;
    }
    while (bad < n && good + 1 < bad) {
      const std::size_t middle = (good + bad) / 2;
      (straight(i, middle) ? good : bad) = middle;
    }
    kept_.push_back(p[good]);
    i = good;
  }
  points->swap(kept_);
}

void PathShortener::split(double longest_m, std::vector<Point2>* points) {
  kept_.clear();
  kept_.push_back(points->front());
  for (std::size_t i = 1; i < points->size(); ++i) {
    const Point2 a = (*points)[i - 1], b = (*points)[i];
    const int parts = std::max(1, static_cast<int>(std::ceil(length_m(a, b) / longest_m)));
    for (int k = 1; k <= parts; ++k) {
      const double t = static_cast<double>(k) / parts;
      kept_.push_back({a.x_m + t * (b.x_m - a.x_m), a.y_m + t * (b.y_m - a.y_m)});
    }
  }
  points->swap(kept_);
}

void PathShortener::shorten(const MapLayer& layer, const ClearancePrice& price, std::vector<Point2>* points) {
  pull(layer, price, points);
  // Corners of the first pass lie where the search put them; between points set anew, the second pass finds
  // shorter cuts. Run backwards, so that its greed has the other direction.
  split(0.4, points);
  std::reverse(points->begin(), points->end());
  pull(layer, price, points);
  std::reverse(points->begin(), points->end());
}

}  // namespace knav
