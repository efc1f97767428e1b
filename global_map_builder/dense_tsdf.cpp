#include "global_map_builder/dense_tsdf.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/multiversion.h"

namespace knav {
namespace {

/// The part of the row at height dy over the sensor that the observation can touch, as offsets from the
/// sensor.
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

constexpr int kChunk = 256;
constexpr double kEnd_cells = 1.5;

/// Which column of the observation sees each cell of a row, -1 for none, and the cells' squared distances.
struct RowProjection {
  float cos_yaw, sin_yaw;  ///< of the sensor
  float first_dx, dy;      ///< of the first cell's centre from the sensor
  float resolution;
  float column_scale, column_shift, columns;
};

KNAV_MULTIVERSION
void project_pinhole(const RowProjection& p, int count, std::int32_t* column, float* square) {
  for (int n = 0; n < count; ++n) {
    const float dx = p.first_dx + p.resolution * static_cast<float>(n);
    const float forward = p.cos_yaw * dx + p.sin_yaw * p.dy;
    const float right = p.sin_yaw * dx - p.cos_yaw * p.dy;
    float u = p.column_shift + p.column_scale * right / (forward > 1e-3f ? forward : 1e-3f);
    u = u < -1.0f ? -1.0f : u;
    u = u > p.columns ? p.columns : u;
    column[n] = forward > 1e-3f && u >= 0.0f && u < p.columns ? static_cast<std::int32_t>(u) : -1;
    square[n] = dx * dx + p.dy * p.dy;
  }
}

/// atan2 to 1e-5 rad, as in core/tsdf_grid.cpp: the same bytes on every target.
inline float angle_of(float y, float x) {
  const float ax = std::fabs(x), ay = std::fabs(y);
  const float high = ax > ay ? ax : ay, low = ax > ay ? ay : ax;
  const float t = low / (high > 1e-12f ? high : 1e-12f), t2 = t * t;
  float a =
      ((((-0.0117212f * t2 + 0.05265332f) * t2 - 0.11643287f) * t2 + 0.19354346f) * t2 - 0.33262347f) * t2;
  a = (a + 0.99997726f) * t;
  a = ay > ax ? 1.57079632679f - a : a;
  a = x < 0.0f ? 3.14159265359f - a : a;
  return y < 0.0f ? -a : a;
}

KNAV_MULTIVERSION
void project_angular(const RowProjection& p, int count, std::int32_t* column, float* square) {
  const float turn = 6.28318530718f * std::fabs(p.column_scale);
  for (int n = 0; n < count; ++n) {
    const float dx = p.first_dx + p.resolution * static_cast<float>(n);
    const float x = p.cos_yaw * dx + p.sin_yaw * p.dy, y = p.cos_yaw * p.dy - p.sin_yaw * dx;
    float u = p.column_shift + p.column_scale * angle_of(y, x);
    u = u < 0.0f ? u + turn : u;  // a scan may start anywhere on the circle
    u = u >= turn ? u - turn : u;
    const float bounded = u < p.columns ? u : p.columns;
    column[n] = bounded >= 0.0f && bounded < p.columns ? static_cast<std::int32_t>(bounded) : -1;
    square[n] = dx * dx + p.dy * p.dy;
  }
}

}  // namespace

ObservationLimits SurfaceConfig::limits() const {
  ObservationLimits limits;
  limits.range_max_m = range_max_m;
  limits.clear_margin_m = 0.0;  // what finds clear tubes is a fifth of an observation's work, and nothing here asks for them
  limits.truncation.base_m = limits.truncation.scan_base_m = front_m;
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
      ended_(geometry.cell_count()),
      looks_(geometry.cell_count()) {}

float DenseTsdf::distance_m(std::size_t i) const {
  return known(i) && weight_[i] > 0.0f ? sum_[i] / weight_[i] : std::numeric_limits<float>::quiet_NaN();
}

void DenseTsdf::renew(const DenseTsdf& later) {
  const double floor_m = std::max(config_.change_range_m, config_.weight_range_floor_m);
  const auto enough = static_cast<float>(min_looks_ * std::pow(floor_m, -config_.weight_power));
  const auto tolerance = static_cast<float>(config_.change_m);
  for (std::size_t i = 0; i < sum_.size(); ++i) {
    const float before = distance_m(i), now = later.distance_m(i);
    if (std::isnan(now)) continue;
    if (std::isnan(before) || (std::fabs(before - now) > tolerance && later.weight_[i] >= enough)) {
      sum_[i] = later.sum_[i];
      weight_[i] = later.weight_[i];
      ended_[i] = later.ended_[i];
      looks_[i] = later.looks_[i];
    } else if (std::fabs(before - now) <= tolerance) {
      sum_[i] += later.sum_[i];
      weight_[i] += later.weight_[i];
      ended_[i] += later.ended_[i];
      looks_[i] = static_cast<std::uint16_t>(std::min(0xFFFF, looks_[i] + later.looks_[i]));
    }
  }
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
  RowProjection p;
  p.cos_yaw = static_cast<float>(std::cos(o.T_map_sensor.yaw_rad));
  p.sin_yaw = static_cast<float>(std::sin(o.T_map_sensor.yaw_rad));
  p.dy = static_cast<float>(geometry_.center_y_m(iy) - o.T_map_sensor.y_m);
  p.resolution = static_cast<float>(geometry_.resolution_m);
  p.columns = static_cast<float>(o.columns());
  if (o.pinhole) {
    p.column_scale = o.fx_px;
    p.column_shift = o.cx_px + 0.5f;
  } else {
    p.column_scale = 1.0f / o.angle_increment_rad;
    p.column_shift = 0.5f - o.angle_min_rad / o.angle_increment_rad;
  }
  std::int32_t column[kChunk];
  float square[kChunk];
  for (int start = from; start < to; start += kChunk) {
    const int count = std::min(kChunk, to - start);
    p.first_dx = static_cast<float>(geometry_.center_x_m(start) - o.T_map_sensor.x_m);
    (o.pinhole ? project_pinhole : project_angular)(p, count, column, square);
    update(o, geometry_.index(start, iy), count, column, square);
  }
}

void DenseTsdf::update(const TsdfObservation& o, std::size_t first, int count, const std::int32_t* column,
                       const float* square) {
  const auto front = static_cast<float>(config_.front_m);
  const auto behind_base =
      static_cast<float>(config_.behind_m - config_.front_m);  // added to the column's mu
  const auto floor2 = static_cast<float>(config_.weight_range_floor_m * config_.weight_range_floor_m);
  const auto power = static_cast<float>(-config_.weight_power / 2.0);
  const auto end = static_cast<float>(kEnd_cells * geometry_.resolution_m);
  const bool fourth = config_.weight_power == 4.0, second = config_.weight_power == 2.0;
  for (int n = 0; n < count; ++n) {
    if (column[n] < 0) continue;
    const auto k = static_cast<std::size_t>(column[n]);
    const float d = std::sqrt(square[n]);
    const float eta = o.range_m[k] - d;  // equation 3; NaN without a surface
    const float mu = o.truncation_m[k], behind = mu + behind_base;
    const bool near_surface = eta >= -behind && eta < mu;
    if (!near_surface && !(d >= o.free_from_m[k] && d <= o.free_to_m[k])) continue;
    const float value = near_surface ? std::min(eta, front) : front;  // equation 2, in metres
    const float bounded = std::max(square[n], floor2);
    float w = fourth ? 1.0f / (bounded * bounded) : second ? 1.0f / bounded : std::pow(bounded, power);
    // The far half of the support behind a surface fades out, so that it yields to what the other side shows.
    if (near_surface && eta < -0.5f * behind) w *= 2.0f * (1.0f + eta / behind) + 0.05f;
    const std::size_t i = first + static_cast<std::size_t>(n);
    sum_[i] += w * value;
    weight_[i] += w;
    if (near_surface && std::fabs(eta) < end) ended_[i] += w;
    if (looks_[i] < 0xFFFF) ++looks_[i];
  }
}

}  // namespace knav
