#include "core/cost_field.h"

#include <algorithm>
#include <cmath>

#include "core/multiversion.h"

namespace knav {
namespace {

std::uint8_t quantized(double cost) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(cost, 0.0, 1.0) * 255.0));
}

/// What of the field the inner loop needs.
struct Field {
  const std::uint32_t* quads;
  int width;
  float last_x, last_y;  ///< points from here on are off the grid [cells]
  float outside;
  float interpolate;  ///< 1 or 0
};

/// Weighted costs of the readings seen from one pose: (x, y) = (x0 + c px - s py, y0 + s px + c py), in cells.
KNAV_MULTIVERSION
void reading_costs(const Field& field, float x0, float y0, float c, float s, const float* px, const float* py,
                   const float* weight, int count, float* out) {
  const std::uint32_t* const quads = field.quads;
  const int width = field.width;
  const float last_x = field.last_x, last_y = field.last_y, outside = field.outside, blend = field.interpolate;
  for (int k = 0; k < count; ++k) {
    const float at_x = x0 + c * px[k] - s * py[k];
    const float at_y = y0 + s * px[k] + c * py[k];
    const float gx = std::min(std::max(at_x, 0.0f), last_x), gy = std::min(std::max(at_y, 0.0f), last_y);
    const int ix = static_cast<int>(gx), iy = static_cast<int>(gy);  // not negative: truncation is floor
    const float tx = (gx - static_cast<float>(ix)) * blend, ty = (gy - static_cast<float>(iy)) * blend;
    const auto quad = static_cast<std::int32_t>(quads[iy * width + ix]);
    const float a = static_cast<float>(quad & 255), b = static_cast<float>((quad >> 8) & 255);
    const float d = static_cast<float>((quad >> 16) & 255), e = static_cast<float>((quad >> 24) & 255);
    const float low = a + tx * (b - a), high = d + tx * (e - d);
    const float value = low + ty * (high - low);
    const float off_grid = std::fabs(gx - at_x) + std::fabs(gy - at_y);
    out[k] = weight[k] * (off_grid > 0.0f ? outside : value);
  }
}

/// Eight running sums, so that scalar and vector code add in the same order.
float sum_of(const float* value, std::size_t count) {
  float lane[8] = {};
  std::size_t k = 0;
  for (; k + 8 <= count; k += 8) {
    for (std::size_t j = 0; j < 8; ++j) lane[j] += value[k + j];
  }
  for (; k < count; ++k) lane[k & 7] += value[k];
  return ((lane[0] + lane[4]) + (lane[1] + lane[5])) + ((lane[2] + lane[6]) + (lane[3] + lane[7]));
}

}  // namespace

CostField::CostField(const GridGeometry& geometry, double outside_cost)
    : geometry_(geometry),
      quad_(geometry.cell_count(), quantized(outside_cost) * 0x01010101u),
      outside_(quantized(outside_cost)) {}

void CostField::put(int ix, int iy, int byte, std::uint8_t value) {
  if (!geometry_.contains(ix, iy)) return;
  std::uint32_t& quad = quad_[geometry_.index(ix, iy)];
  quad = (quad & ~(0xffu << (8 * byte))) | (static_cast<std::uint32_t>(value) << (8 * byte));
}

void CostField::set(int ix, int iy, double cost) {
  const std::uint8_t value = quantized(cost);
  put(ix, iy, 0, value);
  put(ix - 1, iy, 1, value);
  put(ix, iy - 1, 2, value);
  put(ix - 1, iy - 1, 3, value);
}

double CostField::at(int ix, int iy) const {
  return (geometry_.contains(ix, iy) ? quad_[geometry_.index(ix, iy)] & 255u : outside_) / 255.0;
}

void alignment_costs(const CostField& field, const WeightedPoints& points_robot, const ParticleSet& particles,
                     bool interpolate, std::vector<float>* cost) {
  static thread_local std::vector<float> scratch;
  scratch.resize(points_robot.size());
  cost->resize(particles.size());
  const GridGeometry& grid = field.geometry();
  const double scale = 1.0 / grid.resolution_m, shift = interpolate ? 0.5 : 0.0;
  const int margin = interpolate ? 1 : 0;
  const Field view{field.quads(),
                   grid.width_cells,
                   static_cast<float>(grid.width_cells - margin),
                   static_cast<float>(grid.height_cells - margin),
                   static_cast<float>(field.outside()),
                   interpolate ? 1.0f : 0.0f};
  float weight_sum = 0.0f;
  for (const float w : points_robot.weight) weight_sum += w;
  const float to_mean = weight_sum > 0.0f ? 1.0f / (255.0f * weight_sum) : 0.0f;
  const int count = grid.cell_count() > 0 ? static_cast<int>(points_robot.size()) : 0;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const Pose2 T = particles.pose(i);
    const auto c = static_cast<float>(std::cos(T.yaw_rad) * scale), s = static_cast<float>(std::sin(T.yaw_rad) * scale);
    const auto x0 = static_cast<float>((T.x_m - grid.origin_x_m) * scale - shift);
    const auto y0 = static_cast<float>((T.y_m - grid.origin_y_m) * scale - shift);
    reading_costs(view, x0, y0, c, s, points_robot.x_m.data(), points_robot.y_m.data(), points_robot.weight.data(),
                  count, scratch.data());
    (*cost)[i] = sum_of(scratch.data(), static_cast<std::size_t>(count)) * to_mean;
  }
}

}  // namespace knav
