#include "core/tsdf_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/multiversion.h"

namespace knav {
namespace {

/// Which column of the observation sees a cell, and how far the cell is. The first part of equation 3.
struct RowProjection {
  float cos_yaw, sin_yaw;      ///< of the sensor
  float resolution, first_dx;  ///< dx of cell k is first_dx + resolution k
  float dy;
  float column_scale, column_shift;
  int columns;
};

KNAV_MULTIVERSION
void project_row_pinhole(const RowProjection& p, int first, int count, std::int32_t* column,
                         float* distance) {
  const auto columns = static_cast<float>(p.columns);
  for (int k = 0; k < count; ++k) {
    const float dx = p.first_dx + p.resolution * static_cast<float>(first + k);
    const float forward = p.cos_yaw * dx + p.sin_yaw * p.dy;
    const float right = p.sin_yaw * dx - p.cos_yaw * p.dy;
    const float safe = forward > 1e-3f ? forward : 1e-3f;
    float u = p.column_shift + p.column_scale * right / safe;
    u = u < -1.0f ? -1.0f : u;
    u = u > columns ? columns : u;
    const bool seen = forward > 1e-3f && u >= 0.0f && u < columns;
    column[k] = seen ? static_cast<std::int32_t>(u) : -1;
    distance[k] = std::sqrt(dx * dx + p.dy * p.dy);
  }
}

/// atan2 to about 1e-5 rad of every cell of the row, written so that every target computes the same bytes. In
/// passes without branches, which the compiler turns into vector code.
KNAV_MULTIVERSION
void project_row_angular(const RowProjection& p, int first, int count, std::int32_t* column, float* distance,
                         float* angle) {
  for (int k = 0; k < count; ++k) {
    const float dx = p.first_dx + p.resolution * static_cast<float>(first + k);
    const float x = p.cos_yaw * dx + p.sin_yaw * p.dy;
    const float y = p.cos_yaw * p.dy - p.sin_yaw * dx;
    const float ax = std::fabs(x), ay = std::fabs(y);
    const float low = ax < ay ? ax : ay, high = ax < ay ? ay : ax;
    const float t = low / (high + 1e-12f);
    const float t2 = t * t;
    const float a =
        ((((-0.0117212f * t2 + 0.05265332f) * t2 - 0.11643287f) * t2 + 0.19354346f) * t2 - 0.33262347f) * t2;
    const float octant = (a + 0.99997726f) * t;
    // Mirrored as the signs say, by arithmetic: 1 or 0 each.
    const float steep = static_cast<float>(ay > ax), backward = static_cast<float>(x < 0.0f);
    const float quadrant = octant + steep * (1.57079632679f - 2.0f * octant);
    const float half = quadrant + backward * (3.14159265359f - 2.0f * quadrant);
    angle[k] = std::copysign(half, y);
    distance[k] = std::sqrt(dx * dx + p.dy * p.dy);
  }
  const auto columns = static_cast<float>(p.columns);
  const float turn = 6.28318530718f * std::fabs(p.column_scale);
  for (int k = 0; k < count; ++k) {
    float u = p.column_shift + p.column_scale * angle[k];
    u += turn * (static_cast<float>(u < 0.0f) -
                 static_cast<float>(u >= turn));  // it may start anywhere on the circle
    u = u < -1.0f ? -1.0f : u;
    u = u > columns ? columns : u;
    const bool seen = u >= 0.0f && u < columns;
    column[k] = seen ? static_cast<std::int32_t>(u) : -1;
  }
}

/// The part of the row at height dy over the sensor that lies in the disc of its reach and in its view.
bool row_span(const TsdfObservation& o, double dy, double* low, double* high) {
  const double reach = o.reach_m;
  const double square = reach * reach - dy * dy;
  if (square <= 0.0) return false;
  *high = std::sqrt(square);
  *low = -*high;
  // Edge rays, one column wider than the view.
  const double columns = static_cast<double>(o.columns());
  double first, last;
  if (o.pinhole) {
    first = -std::atan((-1.0 - o.cx_px) / o.fx_px);
    last = -std::atan((columns - o.cx_px) / o.fx_px);
  } else {
    first = o.angle_min_rad - o.angle_increment_rad;
    last = o.angle_min_rad + o.angle_increment_rad * columns;
  }
  const double right = o.T_map_sensor.yaw_rad + std::min(first, last);
  const double left = o.T_map_sensor.yaw_rad + std::max(first, last);
  if (left - right >= 2.0 * kPi - 0.02) return true;
  // The half planes left of the right edge and right of the left edge: a narrow view is their intersection, a
  // wide one their union.
  struct Span {
    double low, high;
  };
  const auto clipped = [&](double a, double b) {  // where a dx + b >= 0
    Span span{*low, *high};
    if (a > 1e-9) {
      span.low = std::max(span.low, -b / a);
    } else if (a < -1e-9) {
      span.high = std::min(span.high, -b / a);
    } else if (b < -1e-6) {
      span.high = span.low - 1.0;
    }
    return span;
  };
  const Span r = clipped(-std::sin(right), std::cos(right) * dy);
  const Span l = clipped(std::sin(left), -std::cos(left) * dy);
  if (left - right <= kPi) {
    *low = std::max(r.low, l.low);
    *high = std::min(r.high, l.high);
  } else {
    const bool r_empty = r.low > r.high, l_empty = l.low > l.high;
    if (r_empty && l_empty) return false;
    *low = r_empty ? l.low : l_empty ? r.low : std::min(r.low, l.low);
    *high = r_empty ? l.high : l_empty ? r.high : std::max(r.high, l.high);
  }
  return *low <= *high;
}

}  // namespace

double TsdfConfig::largest_weight() const {
  const double floor2 = weight_range_floor_m * weight_range_floor_m;
  return std::floor(std::ldexp(1.0, weight_bits) / floor2 + 0.5);
}

TsdfGrid::TsdfGrid(const TsdfConfig& config, double half_size_m) : config_(config) {
  const double cells = 2.0 * half_size_m / config.resolution_m;
  while ((1 << bits_) < cells && bits_ < 15) ++bits_;
  size_ = 1 << bits_;
  mask_ = size_ - 1;
  first_x_ = first_y_ = -size_ / 2;
  weight_unit_ = static_cast<float>(std::ldexp(1.0, config.weight_bits));
  const std::size_t count = static_cast<std::size_t>(size_) << bits_;
  weighted_sum_.resize(count);
  weight_.resize(count);
  reset_.resize(count);
  last_seen_s_.resize(count);
  quad_.resize(count);
  contradictions_.resize(count);
  row_column_.resize(static_cast<std::size_t>(size_));
  row_distance_m_.resize(static_cast<std::size_t>(size_));
  row_angle_rad_.resize(static_cast<std::size_t>(size_));
  clear();
}

int TsdfGrid::cell_of(double coordinate_m) const {
  return static_cast<int>(std::floor(coordinate_m / config_.resolution_m));
}

void TsdfGrid::clear() {
  std::fill(weighted_sum_.begin(), weighted_sum_.end(), 0);
  std::fill(weight_.begin(), weight_.end(), 0);
  std::fill(reset_.begin(), reset_.end(), 0u);
  std::fill(last_seen_s_.begin(), last_seen_s_.end(), 0.0f);
  std::fill(quad_.begin(), quad_.end(), 0x80808080u);
  std::fill(contradictions_.begin(), contradictions_.end(), std::uint8_t{0});
}

void TsdfGrid::reset_cell(int ix, int iy, std::uint32_t next_sequence) {
  const std::size_t i = index(ix, iy);
  weighted_sum_[i] = 0;
  weight_[i] = 0;
  reset_[i] = next_sequence;
  last_seen_s_[i] = 0.0f;
  contradictions_[i] = 0;
  set_value(ix, iy, kUnknown);
}

void TsdfGrid::scroll_to(double x_m, double y_m, std::uint32_t next_sequence) {
  // In steps of 16 cells, so that a robot at a cell's edge does not scroll to and fro.
  const auto wanted = [&](double coordinate_m, int first) {
    const int centered = cell_of(coordinate_m) - size_ / 2;
    return std::abs(centered - first) > 16 ? centered : first;
  };
  const int new_x = wanted(x_m, first_x_), new_y = wanted(y_m, first_y_);
  if (new_x == first_x_ && new_y == first_y_) return;
  if (std::abs(new_x - first_x_) >= size_ || std::abs(new_y - first_y_) >= size_) {
    clear();
    first_x_ = new_x;
    first_y_ = new_y;
    std::fill(reset_.begin(), reset_.end(), next_sequence);
    return;
  }
  const int old_x = first_x_, old_y = first_y_;
  first_x_ = new_x;
  first_y_ = new_y;
  for (int iy = new_y; iy < new_y + size_; ++iy) {
    const bool new_row = iy < old_y || iy >= old_y + size_;
    const int entering_low = new_row ? new_x : new_x < old_x ? new_x : old_x + size_;
    const int entering_high = new_row ? new_x + size_ : new_x < old_x ? old_x : new_x + size_;
    for (int ix = entering_low; ix < entering_high; ++ix) reset_cell(ix, iy, next_sequence);
  }
}

void TsdfGrid::set_value(int ix, int iy, std::int8_t value) {
  // The cell is a corner of four quads. The torus' seam mixes both edges of the window; lookups there are
  // outside.
  const std::uint32_t byte = static_cast<std::uint8_t>(value);
  std::uint32_t& a = quad_[index(ix, iy)];
  a = (a & 0xFFFFFF00u) | byte;
  std::uint32_t& b = quad_[index(ix - 1, iy)];
  b = (b & 0xFFFF00FFu) | byte << 8;
  std::uint32_t& c = quad_[index(ix, iy - 1)];
  c = (c & 0xFF00FFFFu) | byte << 16;
  std::uint32_t& d = quad_[index(ix - 1, iy - 1)];
  d = (d & 0x00FFFFFFu) | byte << 24;
}

void TsdfGrid::refresh(int ix, int iy, std::size_t i) {
  const std::int32_t w = weight_[i];
  std::int8_t value = kUnknown;
  if (w > 0) {
    const float f = kValueScale * static_cast<float>(weighted_sum_[i]) / static_cast<float>(w);
    value = static_cast<std::int8_t>(f + (f < 0.0f ? -0.5f : 0.5f));
  }
  if (static_cast<std::int8_t>(quad_[i] & 0xFFu) != value) set_value(ix, iy, value);
}

float TsdfGrid::distance(int ix, int iy) const {
  const std::size_t i = index(ix, iy);
  return weight_[i] > 0 ? static_cast<float>(weighted_sum_[i]) / static_cast<float>(weight_[i])
                        : std::numeric_limits<float>::quiet_NaN();
}

float TsdfGrid::weight(int ix, int iy) const {
  return static_cast<float>(weight_[index(ix, iy)]) / weight_unit_;
}

void TsdfGrid::add(const TsdfObservation& observation) { apply<true>(observation); }
void TsdfGrid::remove(const TsdfObservation& observation) { apply<false>(observation); }

template <bool kAdd>
void TsdfGrid::apply(const TsdfObservation& o) {
  if (!(o.reach_m > 0.0f)) return;
  const int radius = static_cast<int>(o.reach_m / config_.resolution_m) + 2;
  const int sensor_x = cell_of(o.T_map_sensor.x_m), sensor_y = cell_of(o.T_map_sensor.y_m);
  const int low_y = std::max(first_y_, sensor_y - radius);
  const int high_y = std::min(first_y_ + size_, sensor_y + radius + 1);
  for (int iy = low_y; iy < high_y; ++iy) {
    double low = 0.0, high = 0.0;
    if (!row_span(o, center_m(iy) - o.T_map_sensor.y_m, &low, &high)) continue;
    const int from = std::max(first_x_, cell_of(o.T_map_sensor.x_m + low) - 1);
    const int to = std::min(first_x_ + size_, cell_of(o.T_map_sensor.x_m + high) + 2);
    if (from < to) apply_row<kAdd>(o, iy, from - sensor_x, to - sensor_x);
  }
}

template <bool kAdd>
void TsdfGrid::apply_row(const TsdfObservation& o, int iy, int from, int to) {
  // Offsets are counted from the sensor's own cell, an absolute index: a cell's numbers do not depend on
  // where the window lies, so removal after scrolling repeats them to the bit.
  const int sensor_x = cell_of(o.T_map_sensor.x_m), sensor_y = cell_of(o.T_map_sensor.y_m);
  const auto resolution = static_cast<float>(config_.resolution_m);
  RowProjection p;
  p.cos_yaw = static_cast<float>(std::cos(o.T_map_sensor.yaw_rad));
  p.sin_yaw = static_cast<float>(std::sin(o.T_map_sensor.yaw_rad));
  p.resolution = resolution;
  p.first_dx = static_cast<float>(center_m(sensor_x) - o.T_map_sensor.x_m);
  p.dy = static_cast<float>(center_m(sensor_y) - o.T_map_sensor.y_m) +
         resolution * static_cast<float>(iy - sensor_y);
  p.columns = static_cast<int>(o.columns());
  const int count = to - from;
  if (o.pinhole) {
    p.column_scale = o.fx_px;
    p.column_shift = o.cx_px + 0.5f;
    project_row_pinhole(p, from, count, row_column_.data(), row_distance_m_.data());
  } else {
    p.column_scale = 1.0f / o.angle_increment_rad;
    p.column_shift = 0.5f - o.angle_min_rad / o.angle_increment_rad;
    project_row_angular(p, from, count, row_column_.data(), row_distance_m_.data(), row_angle_rad_.data());
  }
  const auto floor_m = static_cast<float>(config_.weight_range_floor_m);
  const float floor2 = floor_m * floor_m;
  const auto support = static_cast<std::int8_t>(0.6f * kValueScale);
  const float mu_clear = 2.0f * resolution;
  for (int k = 0; k < count; ++k) {
    const std::int32_t column = row_column_[static_cast<std::size_t>(k)];
    if (column < 0) continue;
    const auto u = static_cast<std::size_t>(column);
    const float d = row_distance_m_[static_cast<std::size_t>(k)];
    const float eta = o.range_m[u] - d;  // NaN without a surface
    const float mu = o.truncation_m[u];
    const bool near_surface = eta >= -mu && eta < mu;
    const bool carved = !near_surface && d >= o.free_from_m[u] && d <= o.free_to_m[u];
    if (!near_surface && !carved) continue;
    const float f = near_surface ? eta / mu : 1.0f;  // equation 2: min(1, |eta| / mu) sgn(eta)
    const float square = d * d > floor2 ? d * d : floor2;
    float weight = weight_unit_ / square;  // equation 4
    if (eta < 0.0f) {
      const float depth = -eta / mu;
      const float share = depth <= o.behind_full ? 1.0f : (1.0f - depth) / (1.0f - o.behind_full);
      for (int power = 0; power < o.behind_power; ++power) weight *= share;
      weight = weight < 1.0f ? 1.0f : weight;  // stays known
    }
    const auto w = static_cast<std::int32_t>(weight + 0.5f);
    const float product = f * static_cast<float>(w);
    const auto fw = static_cast<std::int32_t>(product + (product < 0.0f ? -0.5f : 0.5f));
    const int ix = sensor_x + from + k;
    const std::size_t i = index(ix, iy);
    if constexpr (kAdd) {
      const auto held = static_cast<std::int8_t>(quad_[i] & 0xFFu);
      if (carved && held != kUnknown && held < support && d > o.clear_from_m[u] &&
          d + mu_clear < o.clear_to_m[u]) {
        if (++contradictions_[i] >= config_.contradictions_to_reset) {
          weighted_sum_[i] = 0;
          weight_[i] = 0;
          reset_[i] = o.sequence;
          contradictions_[i] = 0;
          ++contradicted_;
        }
      } else if (near_surface) {
        contradictions_[i] = 0;
      }
      weighted_sum_[i] += fw;
      weight_[i] += w;
      last_seen_s_[i] = o.age_clock_s;
    } else {
      if (reset_[i] > o.sequence) continue;
      weighted_sum_[i] -= fw;
      weight_[i] -= w;
    }
    refresh(ix, iy, i);
  }
}

float interpolate(const TsdfGrid& grid, double x_m, double y_m, float* value) {
  const double gx = x_m / grid.resolution_m() - 0.5, gy = y_m / grid.resolution_m() - 0.5;
  const double fx = std::floor(gx), fy = std::floor(gy);
  const int ix = static_cast<int>(fx), iy = static_cast<int>(fy);
  if (!grid.contains(ix, iy) || !grid.contains(ix + 1, iy + 1)) return 0.0f;
  const std::uint32_t quad = grid.quads()[grid.index(ix, iy)];
  const auto tx = static_cast<float>(gx - fx), ty = static_cast<float>(gy - fy);
  const float share[4] = {(1 - tx) * (1 - ty), tx * (1 - ty), (1 - tx) * ty, tx * ty};
  float sum = 0.0f, known = 0.0f;
  for (int corner = 0; corner < 4; ++corner) {
    const auto byte = static_cast<std::int8_t>((quad >> (8 * corner)) & 0xFFu);
    if (byte == TsdfGrid::kUnknown) continue;
    sum += share[corner] * static_cast<float>(byte);
    known += share[corner];
  }
  if (known > 0.0f) *value = sum / (known * TsdfGrid::kValueScale);
  return known;
}

}  // namespace knav
