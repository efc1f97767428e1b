#include "global_map_builder/dense_tsdf.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace knav {
namespace {

/// The part of the row at height dy over the sensor that the observation can touch, as offsets from the sensor.
bool row_span(const TsdfObservation& o, float cos_yaw, float sin_yaw, double dy, double* low, double* high) {
  const double square = static_cast<double>(o.reach_m) * o.reach_m - dy * dy;
  if (square <= 0.0) return false;
  *high = std::sqrt(square);
  *low = -*high;
  if (!o.pinhole) return true;
  // A pinhole's view is a wedge between two rays r and l: cross(r, p) >= 0 and cross(l, p) <= 0.
  const double right_slope = (static_cast<double>(o.columns()) - o.cx_px) / o.fx_px;
  const double left_slope = (-1.0 - o.cx_px) / o.fx_px;
  const auto clip = [&](double a, double b) {  // a dx + b >= 0
    if (a > 1e-12) {
      *low = std::max(*low, -b / a);
    } else if (a < -1e-12) {
      *high = std::min(*high, -b / a);
    } else if (b < 0.0) {
      *high = *low - 1.0;
    }
  };
  clip(-(sin_yaw - cos_yaw * right_slope), (cos_yaw + sin_yaw * right_slope) * dy);
  clip(sin_yaw - cos_yaw * left_slope, -(cos_yaw + sin_yaw * left_slope) * dy);
  return *low <= *high;
}

}  // namespace

ObservationLimits SurfaceConfig::limits() const {
  ObservationLimits limits;
  limits.range_max_m = range_max_m;
  limits.truncation.base_m = front_m;
  limits.truncation.per_range_squared = per_range_squared;
  limits.truncation.limit_m = 10.0;
  return limits;
}

DenseTsdf::DenseTsdf(const GridGeometry& geometry, const SurfaceConfig& config)
    : geometry_(geometry),
      config_(config),
      min_looks_(config.min_looks),
      sum_(geometry.cell_count()),
      weight_(geometry.cell_count()),
      looks_(geometry.cell_count()) {}

float DenseTsdf::distance_m(std::size_t i) const {
  return known(i) && weight_[i] > 0.0f ? sum_[i] / weight_[i] : std::numeric_limits<float>::quiet_NaN();
}

void DenseTsdf::add(const TsdfObservation& o, int first_row, int last_row) {
  if (!(o.reach_m > 0.0f)) return;
  const auto c = static_cast<float>(std::cos(o.T_map_sensor.yaw_rad));
  const auto s = static_cast<float>(std::sin(o.T_map_sensor.yaw_rad));
  const int low_y = std::max(first_row, geometry_.cell_y(o.T_map_sensor.y_m - o.reach_m) - 1);
  const int high_y = std::min(last_row, geometry_.cell_y(o.T_map_sensor.y_m + o.reach_m) + 2);
  for (int iy = low_y; iy < high_y; ++iy) {
    double low = 0.0, high = 0.0;
    if (!row_span(o, c, s, geometry_.center_y_m(iy) - o.T_map_sensor.y_m, &low, &high)) continue;
    const int from = std::max(0, geometry_.cell_x(o.T_map_sensor.x_m + low) - 1);
    const int to = std::min(geometry_.width_cells, geometry_.cell_x(o.T_map_sensor.x_m + high) + 2);
    if (from < to) add_row(o, iy, from, to);
  }
}

void DenseTsdf::add_row(const TsdfObservation& o, int iy, int from, int to) {
  const auto c = static_cast<float>(std::cos(o.T_map_sensor.yaw_rad));
  const auto s = static_cast<float>(std::sin(o.T_map_sensor.yaw_rad));
  const auto dy = static_cast<float>(geometry_.center_y_m(iy) - o.T_map_sensor.y_m);
  const auto columns = static_cast<float>(o.columns());
  const auto front = static_cast<float>(config_.front_m);
  const auto behind_base = static_cast<float>(config_.behind_m - config_.front_m);  // added to the column's mu
  const auto floor_m = static_cast<float>(config_.weight_range_floor_m);
  const auto power = static_cast<float>(-config_.weight_power / 2.0);
  const bool fourth = config_.weight_power == 4.0, second = config_.weight_power == 2.0;
  for (int ix = from; ix < to; ++ix) {
    const auto dx = static_cast<float>(geometry_.center_x_m(ix) - o.T_map_sensor.x_m);
    const float forward = c * dx + s * dy, left = c * dy - s * dx;
    float u;
    if (o.pinhole) {
      if (forward < 1e-3f) continue;
      u = o.cx_px + 0.5f - o.fx_px * left / forward;
    } else {
      u = 0.5f + (std::atan2(left, forward) - o.angle_min_rad) / o.angle_increment_rad;
      const float turn = 6.28318531f / std::fabs(o.angle_increment_rad);
      if (u < 0.0f) u += turn;
      if (u >= turn) u -= turn;
    }
    if (!(u >= 0.0f && u < columns)) continue;
    const auto k = static_cast<std::size_t>(u);
    const float square = dx * dx + dy * dy, d = std::sqrt(square);
    const float eta = o.range_m[k] - d;  // equation 3; NaN without a surface
    const float mu = o.truncation_m[k], behind = mu + behind_base;
    const bool near_surface = eta >= -behind && eta < mu;
    if (!near_surface && !(d >= o.free_from_m[k] && d <= o.free_to_m[k])) continue;
    const float value = near_surface ? std::min(eta, front) : front;  // equation 2, in metres
    const float bounded = std::max(square, floor_m * floor_m);
    float w = fourth ? 1.0f / (bounded * bounded) : second ? 1.0f / bounded : std::pow(bounded, power);
    // The far half of the support behind a surface fades out, so that it yields to what the other side shows.
    if (near_surface && eta < -0.5f * behind) w *= 2.0f * (1.0f + eta / behind) + 0.05f;
    const std::size_t i = geometry_.index(ix, iy);
    sum_[i] += w * value;
    weight_[i] += w;
    if (looks_[i] < 0xFFFF) ++looks_[i];
  }
}

}  // namespace knav
