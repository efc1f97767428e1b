#include "core/cost_field.h"

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

std::uint8_t quantized(double cost) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(cost, 0.0, 1.0) * 255.0));
}

}  // namespace

CostField::CostField(const GridGeometry& geometry, double outside_cost)
    : geometry_(geometry), cost_(geometry.cell_count(), quantized(outside_cost)), outside_(quantized(outside_cost)) {}

void CostField::set_geometry_origin(double origin_x_m, double origin_y_m) {
  geometry_.origin_x_m = origin_x_m;
  geometry_.origin_y_m = origin_y_m;
}

void CostField::set(int ix, int iy, double cost) { cost_[geometry_.index(ix, iy)] = quantized(cost); }

double CostField::at(int ix, int iy) const {
  return (geometry_.contains(ix, iy) ? cost_[geometry_.index(ix, iy)] : outside_) / 255.0;
}

void alignment_costs(const CostField& field, const WeightedPoints& points_robot, const ParticleSet& particles,
                     bool interpolate, std::vector<float>* cost) {
  const GridGeometry& grid = field.geometry();
  const auto scale = static_cast<float>(1.0 / grid.resolution_m);
  const float shift = interpolate ? 0.5f : 0.0f;
  const float outside = field.outside();
  const std::uint8_t* data = field.data();
  const auto width = static_cast<std::size_t>(grid.width_cells);
  float weight_sum = 0.0f;
  for (const float w : points_robot.weight) weight_sum += w;
  const float to_mean = weight_sum > 0.0f ? 1.0f / (255.0f * weight_sum) : 0.0f;
  cost->resize(particles.size());
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const Pose2 T = particles.pose(i);
    const auto c = static_cast<float>(std::cos(T.yaw_rad)) * scale;
    const auto s = static_cast<float>(std::sin(T.yaw_rad)) * scale;
    const float x0 = static_cast<float>((T.x_m - grid.origin_x_m) / grid.resolution_m) - shift;
    const float y0 = static_cast<float>((T.y_m - grid.origin_y_m) / grid.resolution_m) - shift;
    float sum = 0.0f;
    for (std::size_t k = 0; k < points_robot.size(); ++k) {
      const float gx = x0 + c * points_robot.x_m[k] - s * points_robot.y_m[k];
      const float gy = y0 + s * points_robot.x_m[k] + c * points_robot.y_m[k];
      const float fx = std::floor(gx), fy = std::floor(gy);
      const int ix = static_cast<int>(fx), iy = static_cast<int>(fy);
      float value = outside;
      if (!interpolate) {
        if (grid.contains(ix, iy)) value = data[grid.index(ix, iy)];
      } else if (ix >= 0 && iy >= 0 && ix + 1 < grid.width_cells && iy + 1 < grid.height_cells) {
        const std::uint8_t* q = data + grid.index(ix, iy);
        const float tx = gx - fx, ty = gy - fy;
        const float low = static_cast<float>(q[0]) + tx * static_cast<float>(q[1] - q[0]);
        const float high = static_cast<float>(q[width]) + tx * static_cast<float>(q[width + 1] - q[width]);
        value = low + ty * (high - low);
      }
      sum += points_robot.weight[k] * value;
    }
    (*cost)[i] = sum * to_mean;
  }
}

}  // namespace knav
