#include "core/distance_transform.h"

#include <cmath>
#include <limits>
#include <stdexcept>

namespace knav {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();

/// Lower envelope of the parabolas (q - i)^2 + f[i] along one line; scratch vectors are reused across lines.
class LineTransform {
 public:
  explicit LineTransform(std::size_t length) : f(length), d_(length), v_(length), z_(length + 1) {}

  const std::vector<double>& run() {
    const int n = static_cast<int>(f.size());
    int k = -1;
    for (int q = 0; q < n; ++q) {
      if (f[at(q)] == kFar) continue;
      double s = -kFar;
      while (k >= 0) {
        const int p = v_[at(k)];
        s = ((f[at(q)] + static_cast<double>(q) * q) - (f[at(p)] + static_cast<double>(p) * p)) / (2.0 * (q - p));
        if (s > z_[at(k)]) break;
        --k;
        s = -kFar;
      }
      ++k;
      v_[at(k)] = q;
      z_[at(k)] = s;
      z_[at(k) + 1] = kFar;
    }
    if (k < 0) {
      d_.assign(f.size(), kFar);
      return d_;
    }
    for (int q = 0, j = 0; q < n; ++q) {
      while (z_[at(j) + 1] < q) ++j;
      const double offset = q - v_[at(j)];
      d_[at(q)] = offset * offset + f[at(v_[at(j)])];
    }
    return d_;
  }

  std::vector<double> f;

 private:
  static std::size_t at(int i) { return static_cast<std::size_t>(i); }
  std::vector<double> d_;
  std::vector<int> v_;
  std::vector<double> z_;
};

}  // namespace

std::vector<float> euclidean_distance_m(const GridGeometry& geometry, const std::vector<std::uint8_t>& occupied) {
  if (occupied.size() != geometry.cell_count()) throw std::invalid_argument("occupied has not one entry per cell");
  const auto width = static_cast<std::size_t>(geometry.width_cells);
  const auto height = static_cast<std::size_t>(geometry.height_cells);
  std::vector<double> squared(occupied.size());
  LineTransform column(height);
  for (std::size_t x = 0; x < width; ++x) {
    for (std::size_t y = 0; y < height; ++y) column.f[y] = occupied[y * width + x] ? 0.0 : kFar;
    const auto& d = column.run();
    for (std::size_t y = 0; y < height; ++y) squared[y * width + x] = d[y];
  }
  std::vector<float> distance(occupied.size());
  LineTransform row(width);
  for (std::size_t y = 0; y < height; ++y) {
    for (std::size_t x = 0; x < width; ++x) row.f[x] = squared[y * width + x];
    const auto& d = row.run();
    for (std::size_t x = 0; x < width; ++x) {
      distance[y * width + x] = static_cast<float>(std::sqrt(d[x]) * geometry.resolution_m);
    }
  }
  return distance;
}

}  // namespace knav
