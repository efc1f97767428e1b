#include "core/tsdf_alignment.h"

#include <algorithm>
#include <cmath>

#include "core/multiversion.h"

namespace knav {
namespace {

/// What of the grid the inner loop needs. Coordinates count cells from the window's lower left corner.
struct Window {
  const std::uint32_t* quads;
  int bits, mask, size;
  int first_x, first_y;
  float price;
};

/// Costs of the readings seen from one pose: (x, y) = (x0 + c px - s py, y0 + s px + c py), in cells.
KNAV_MULTIVERSION
void reading_costs(const Window& window, float x0, float y0, float c, float s, const float* px,
                   const float* py, const float* weight, int count, float* out) {
  const float last = static_cast<float>(window.size - 1);
  const int bits = window.bits, mask = window.mask, first_x = window.first_x, first_y = window.first_y;
  const float price = window.price;
  const std::uint32_t* const quads = window.quads;
  for (int k = 0; k < count; ++k) {
    float gx = x0 + c * px[k] - s * py[k];
    float gy = y0 + s * px[k] + c * py[k];
    const bool inside = gx >= 0.0f && gy >= 0.0f && gx < last && gy < last;
    gx = inside ? gx : 0.0f;
    gy = inside ? gy : 0.0f;
    const int ix = static_cast<int>(gx), iy = static_cast<int>(gy);  // not negative: truncation is floor
    const float tx = gx - static_cast<float>(ix), ty = gy - static_cast<float>(iy);
    const int index = (((iy + first_y) & mask) << bits) | ((ix + first_x) & mask);
    const std::uint32_t quad = quads[index];  // unsigned to shift left, signed to shift back with the sign
    const int a = static_cast<std::int32_t>(quad << 24) >> 24, b = static_cast<std::int32_t>(quad << 16) >> 24;
    const int d = static_cast<std::int32_t>(quad << 8) >> 24, e = static_cast<std::int32_t>(quad) >> 24;
    const float share_a = a == -128 ? 0.0f : (1.0f - tx) * (1.0f - ty);
    const float share_b = b == -128 ? 0.0f : tx * (1.0f - ty);
    const float share_d = d == -128 ? 0.0f : (1.0f - tx) * ty;
    const float share_e = e == -128 ? 0.0f : tx * ty;
    const float known = share_a + share_b + share_d + share_e;
    const float value = share_a * static_cast<float>(a) + share_b * static_cast<float>(b) +
                        share_d * static_cast<float>(d) + share_e * static_cast<float>(e);
    const float inside_cost = std::fabs(value) * (1.0f / TsdfGrid::kValueScale) + (1.0f - known) * price;
    out[k] = weight[k] * (inside ? inside_cost : price);
  }
}

/// Eight running sums, so that scalar and vector code add in the same order.
float sum_of(const float* value, int count) {
  float lane[8] = {};
  int k = 0;
  for (; k + 8 <= count; k += 8) {
    for (int j = 0; j < 8; ++j) lane[j] += value[k + j];
  }
  for (; k < count; ++k) lane[k & 7] += value[k];
  return ((lane[0] + lane[4]) + (lane[1] + lane[5])) + ((lane[2] + lane[6]) + (lane[3] + lane[7]));
}

}  // namespace

void tsdf_alignment_costs(const TsdfGrid& grid, const WeightedPoints& points, const ParticleSet& particles,
                          float unknown_price, std::vector<float>* cost) {
  static thread_local std::vector<float> scratch;
  scratch.resize(points.size());
  cost->resize(particles.size());
  float weight_sum = 0.0f;
  for (const float w : points.weight) weight_sum += w;
  const float to_mean = weight_sum > 0.0f ? 1.0f / weight_sum : 0.0f;
  const Window window{grid.quads(),   grid.bits(),    grid.size_cells() - 1, grid.size_cells(),
                      grid.first_x(), grid.first_y(), unknown_price};
  const double scale = 1.0 / grid.resolution_m();
  const int count = static_cast<int>(points.size());
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const Pose2 T = particles.pose(i);
    const auto x0 = static_cast<float>(T.x_m * scale - 0.5 - grid.first_x());
    const auto y0 = static_cast<float>(T.y_m * scale - 0.5 - grid.first_y());
    const auto c = static_cast<float>(std::cos(T.yaw_rad) * scale),
               s = static_cast<float>(std::sin(T.yaw_rad) * scale);
    reading_costs(window, x0, y0, c, s, points.x_m.data(), points.y_m.data(), points.weight.data(), count,
                  scratch.data());
    (*cost)[i] = sum_of(scratch.data(), count) * to_mean;
  }
}

void weigh_by_known_share(const TsdfGrid& grid, const ParticleSet& particles, int hypotheses,
                          WeightedPoints* points) {
  const std::size_t count = std::min(particles.size(), static_cast<std::size_t>(std::max(1, hypotheses)));
  std::fill(points->weight.begin(), points->weight.end(), 0.0f);
  for (std::size_t h = 0; h < count; ++h) {
    const Pose2 T = particles.pose(h * particles.size() / count);
    const double c = std::cos(T.yaw_rad), s = std::sin(T.yaw_rad);
    for (std::size_t k = 0; k < points->size(); ++k) {
      const double x = points->x_m[k], y = points->y_m[k];
      const int ix = grid.cell_of(T.x_m + c * x - s * y), iy = grid.cell_of(T.y_m + s * x + c * y);
      if (grid.contains(ix, iy) && grid.known(ix, iy)) points->weight[k] += 1.0f;
    }
  }
  for (float& w : points->weight) {
    const float share = w / static_cast<float>(count);
    w = share * share;
  }
}

void tsdf_paper_costs(const TsdfGrid& grid, const WeightedPoints& points, const ParticleSet& particles,
                      std::vector<float>* cost, float* mean_weight) {
  cost->resize(particles.size());
  const double unit = grid.weight_unit();
  double weight_sum = 0.0, known = 0.0;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const Pose2 T = particles.pose(i);
    const double c = std::cos(T.yaw_rad), s = std::sin(T.yaw_rad);
    double sum = 0.0;
    for (std::size_t k = 0; k < points.size(); ++k) {
      const double x = points.x_m[k], y = points.y_m[k];
      const int ix = grid.cell_of(T.x_m + c * x - s * y), iy = grid.cell_of(T.y_m + s * x + c * y);
      if (!grid.contains(ix, iy)) continue;
      const std::size_t cell = grid.index(ix, iy);
      sum += std::fabs(static_cast<double>(grid.weighted_sums()[cell]));
      if (grid.weights()[cell] > 0) {
        weight_sum += grid.weights()[cell];
        known += 1.0;
      }
    }
    (*cost)[i] = static_cast<float>(sum / unit);
  }
  *mean_weight = known > 0.0 ? static_cast<float>(weight_sum / (known * unit)) : 0.0f;
}

}  // namespace knav
