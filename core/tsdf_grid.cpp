#include "core/tsdf_grid.h"

#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/multiversion.h"
#include "core/tsdf_projection.h"

namespace knav {
namespace {

constexpr int kPartsAThread = 4;  // rows differ in length
constexpr int kFewestRows = 16;   // of a part

KNAV_MULTIVERSION
void pack_quads(const std::int8_t* lower, const std::int8_t* upper, int count, std::uint32_t* quad) {
  for (int k = 0; k < count; ++k) {
    quad[k] = static_cast<std::uint32_t>(static_cast<std::uint8_t>(lower[k])) |
              static_cast<std::uint32_t>(static_cast<std::uint8_t>(lower[k + 1])) << 8 |
              static_cast<std::uint32_t>(static_cast<std::uint8_t>(upper[k])) << 16 |
              static_cast<std::uint32_t>(static_cast<std::uint8_t>(upper[k + 1])) << 24;
  }
}

}  // namespace

double TsdfConfig::largest_weight() const {
  const double floor2 = weight_range_floor_m * weight_range_floor_m;
  return std::floor(std::ldexp(1.0, weight_bits) / floor2 + 0.5);
}

TsdfGrid::TsdfGrid(const TsdfConfig& config, double half_size_m, bool vectors) : config_(config) {
  const double cells = 2.0 * half_size_m / config.resolution_m;
  while ((1 << bits_) < cells && bits_ < 15) ++bits_;
  size_ = 1 << bits_;
  mask_ = size_ - 1;
  first_x_ = first_y_ = -size_ / 2;
  weight_unit_ = static_cast<float>(std::ldexp(1.0, config.weight_bits));
  const std::size_t count = static_cast<std::size_t>(size_) << bits_;
  rules_.weight_unit = weight_unit_;
  rules_.weight_range_floor_m = static_cast<float>(config.weight_range_floor_m);
  rules_.resolution_m = static_cast<float>(config.resolution_m);
  rules_.contradictions_to_reset = config.contradictions_to_reset;
  rules_.middle_clear_from_m = static_cast<float>(config.middle_clear_from_m);
  rules_.standing_clear_to_m = static_cast<float>(config.low_clear_range_m);
  rules_.front_clear_to_m = static_cast<float>(config.front_clear_range_m);
  rules_.appear_to_m = static_cast<float>(config.appear_range_m);
  rules_.low_appear_to_m =
      config.appear_range_m > 0.0 ? std::max(rules_.appear_to_m, rules_.standing_clear_to_m) : 0.0f;
  rules_.vectors = vectors;
  deficit_.resize(count);
  weight_.resize(count);
  standing_weight_.resize(count);
  value_.resize(count);
  reset_.resize(count);
  last_seen_s_.resize(count);
  quad_stride_ = size_ + 16;
  quad_.resize(static_cast<std::size_t>(size_) * static_cast<std::size_t>(quad_stride_));
  contradictions_.resize(count);
  rows_.resize(config.threads > 1 ? static_cast<std::size_t>(kPartsAThread * config.threads) : 1);
  for (Rows& rows : rows_) {
    rows.column.resize(static_cast<std::size_t>(size_));
    rows.distance_m.resize(static_cast<std::size_t>(size_));
    rows.angle_rad.resize(static_cast<std::size_t>(size_));
  }
  clear();
}

int TsdfGrid::cell_of(double coordinate_m) const {
  return static_cast<int>(std::floor(coordinate_m / config_.resolution_m));
}

void TsdfGrid::clear() {
  std::fill(deficit_.begin(), deficit_.end(), 0u);
  std::fill(weight_.begin(), weight_.end(), 0);
  std::fill(standing_weight_.begin(), standing_weight_.end(), 0);
  std::fill(value_.begin(), value_.end(), kUnknown);
  std::fill(reset_.begin(), reset_.end(), 0u);
  std::fill(last_seen_s_.begin(), last_seen_s_.end(), 0.0f);
  std::fill(quad_.begin(), quad_.end(), 0x80808080u);
  std::fill(contradictions_.begin(), contradictions_.end(), std::uint8_t{0});
}

void TsdfGrid::reset_cell(int ix, int iy, std::uint32_t next_sequence) {
  const std::size_t i = index(ix, iy);
  deficit_[i] = 0;
  weight_[i] = 0;
  standing_weight_[i] = 0;
  reset_[i] = next_sequence;
  last_seen_s_[i] = 0.0f;
  contradictions_[i] = 0;
  value_[i] = kUnknown;
  // The cell is a corner of four quads. The torus' seam mixes both edges of the window; lookups there are outside.
  const std::uint32_t byte = static_cast<std::uint8_t>(kUnknown);
  std::uint32_t& a = quad_[quad_index(ix, iy)];
  a = (a & 0xFFFFFF00u) | byte;
  std::uint32_t& b = quad_[quad_index(ix - 1, iy)];
  b = (b & 0xFFFF00FFu) | byte << 8;
  std::uint32_t& c = quad_[quad_index(ix, iy - 1)];
  c = (c & 0xFF00FFFFu) | byte << 16;
  std::uint32_t& d = quad_[quad_index(ix - 1, iy - 1)];
  d = (d & 0x00FFFFFFu) | byte << 24;
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

float TsdfGrid::distance(int ix, int iy) const {
  const std::size_t i = index(ix, iy);
  return weight_[i] > 0 ? static_cast<float>(weighted_sum_units(i)) / static_cast<float>(weight_[i])
                        : std::numeric_limits<float>::quiet_NaN();
}

float TsdfGrid::weight(int ix, int iy) const {
  return static_cast<float>(weight_[index(ix, iy)]) / weight_unit_;
}

void TsdfGrid::add(const TsdfObservation& observation) { apply<true>(observation, {}); }
void TsdfGrid::remove(const TsdfObservation& observation, const TsdfRing& part) { apply<false>(observation, part); }

/// How far a row of cells takes part in an observation.
double TsdfGrid::row_reach_m(const TsdfObservation& o, int iy) const {
  const double reach_m = o.reach_m, every_m = config_.every_row_to_m;
  const std::uint32_t turn = (static_cast<std::uint32_t>(iy) + o.sequence) & 3u;
  if (!o.pinhole || every_m <= 0.0 || turn == 0) return reach_m;
  return std::min(reach_m, turn == 2 ? 2.0 * every_m : every_m);
}

template <bool kAdd>
void TsdfGrid::apply(const TsdfObservation& o, const TsdfRing& part) {
  if (!(o.reach_m > 0.0f)) return;
  const int radius = static_cast<int>(std::min(o.reach_m, part.to_m) / config_.resolution_m) + 2;
  const int sensor_y = cell_of(o.T_map_sensor.y_m);
  const int low_y = std::max(first_y_, sensor_y - radius);
  const int high_y = std::min(first_y_ + size_, sensor_y + radius + 1);
  if (low_y >= high_y) return;
  const int parts = std::clamp((high_y - low_y) / kFewestRows, 1, static_cast<int>(rows_.size()));
  const auto start_of = [&](int k) { return low_y + (high_y - low_y) * k / parts; };
  const auto apply_part = [&](int k) {
    apply_rows<kAdd>(o, part, start_of(k), start_of(k + 1), &rows_[static_cast<std::size_t>(k)]);
  };
  if (parts == 1) {
    apply_part(0);
  } else {
    tbb::parallel_for(0, parts, apply_part, tbb::simple_partitioner());
  }
  // Sums are of integers, and what is left stands between two parts: the same bytes whatever the number of threads.
  rebuild_quads(low_y - 1, {}, rows_[0].first);
  for (int k = 0; k < parts; ++k) {
    Rows& rows = rows_[static_cast<std::size_t>(k)];
    rebuild_quads(start_of(k + 1) - 1, rows.last, k + 1 < parts ? rows_[static_cast<std::size_t>(k) + 1].first : TsdfChange{});
    contradicted_ += rows.contradicted;
  }
}

template <bool kAdd>
void TsdfGrid::apply_rows(const TsdfObservation& o, const TsdfRing& part, int low_y, int high_y, Rows* rows) {
  const TsdfView view(o);
  const double most_m = std::min(o.reach_m, part.to_m);
  const auto cos_yaw = static_cast<float>(std::cos(o.T_map_sensor.yaw_rad));
  const auto sin_yaw = static_cast<float>(std::sin(o.T_map_sensor.yaw_rad));
  rows->contradicted = 0;
  for (int iy = low_y; iy < high_y; ++iy) {
    double low = 0.0, high = 0.0;
    TsdfChange change;
    if (view.span(center_m(iy) - o.T_map_sensor.y_m, std::min(row_reach_m(o, iy), most_m), &low, &high)) {
      // Whole groups of eight, which vector code takes at once.
      const int from = std::max(first_x_, (cell_of(o.T_map_sensor.x_m + low) - 1) & ~7);
      const int to = std::min(first_x_ + size_, (cell_of(o.T_map_sensor.x_m + high) + 9) & ~7);
      if (from < to) change = apply_row<kAdd>(o, cos_yaw, sin_yaw, iy, from, to, part, rows);
    }
    if (iy == low_y) {
      rows->first = change;
    } else {
      rebuild_quads(iy - 1, rows->last, change);
    }
    rows->last = change;
  }
}

/// A row of quads stands on two rows of cells, which changed here.
void TsdfGrid::rebuild_quads(int iy, const TsdfChange& below, const TsdfChange& above) {
  if (below.empty() && above.empty()) return;
  rebuild_quads(iy, std::min(below.first, above.first) - 1, std::max(below.last, above.last) + 1);
}

template <bool kAdd>
TsdfChange TsdfGrid::apply_row(const TsdfObservation& o, float cos_yaw, float sin_yaw, int iy, int from_x, int to_x,
                               const TsdfRing& part, Rows* rows) {
  // Offsets are counted from the sensor's own cell, an absolute index: a cell's numbers do not depend on
  // where the window lies, so removal after scrolling repeats them to the bit.
  const int sensor_x = cell_of(o.T_map_sensor.x_m), sensor_y = cell_of(o.T_map_sensor.y_m);
  const auto resolution = static_cast<float>(config_.resolution_m);
  TsdfRowProjection p;
  p.cos_yaw = cos_yaw;
  p.sin_yaw = sin_yaw;
  p.resolution = resolution;
  p.first_dx = static_cast<float>(center_m(sensor_x) - o.T_map_sensor.x_m);
  p.dy = static_cast<float>(center_m(sensor_y) - o.T_map_sensor.y_m) +
         resolution * static_cast<float>(iy - sensor_y);
  p.columns = static_cast<int>(o.columns());
  const int count = to_x - from_x;
  if (o.pinhole) {
    p.column_scale = o.fx_px;
    p.column_shift = o.cx_px + 0.5f;
    project_row_pinhole(p, from_x - sensor_x, count, rows->column.data(), rows->distance_m.data());
  } else {
    p.column_scale = 1.0f / o.angle_increment_rad;
    p.column_shift = 0.5f - o.angle_min_rad / o.angle_increment_rad;
    project_row_angular(p, from_x - sensor_x, count, rows->column.data(), rows->distance_m.data(),
                        rows->angle_rad.data());
  }
  if (!part.all()) {
    for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
      const float d = rows->distance_m[i];
      rows->column[i] = d >= part.from_m && d < part.to_m ? rows->column[i] : -1;
    }
  }
  TsdfChange all;
  for (int x = from_x; x < to_x;) {  // the torus cuts a row in two pieces at most
    const int piece = std::min(to_x - x, size_ - (x & mask_));
    const std::size_t i = index(x, iy);
    const TsdfCells cells{&deficit_[i],     &weight_[i],         &standing_weight_[i], &reset_[i],
                          &last_seen_s_[i],  &contradictions_[i], &value_[i]};
    const std::int32_t* const column = rows->column.data() + (x - from_x);
    const float* const distance = rows->distance_m.data() + (x - from_x);
    TsdfChange change;
    if constexpr (kAdd) {
      change = add_to_cells(rules_, o, column, distance, piece, cells, &rows->contradicted);
    } else {
      change = remove_from_cells(rules_, o, column, distance, piece, cells);
    }
    if (!change.empty()) {
      all.add(x + change.first);
      all.add(x + change.last);
    }
    x += piece;
  }
  return all;
}

void TsdfGrid::rebuild_quads(int iy, int from_x, int to_x) {
  const std::size_t lower = index(0, iy), upper = index(0, iy + 1), out = quad_index(0, iy);
  for (int x = from_x; x < to_x;) {
    const int i = x & mask_;
    const int piece = std::min(to_x - x, mask_ - i);
    if (piece == 0) {  // the seam
      const std::int8_t left[2] = {value_[lower + static_cast<std::size_t>(i)], value_[lower]};
      const std::int8_t right[2] = {value_[upper + static_cast<std::size_t>(i)], value_[upper]};
      pack_quads(left, right, 1, &quad_[out + static_cast<std::size_t>(i)]);
      ++x;
      continue;
    }
    pack_quads(&value_[lower + static_cast<std::size_t>(i)], &value_[upper + static_cast<std::size_t>(i)], piece,
               &quad_[out + static_cast<std::size_t>(i)]);
    x += piece;
  }
}

float interpolate(const TsdfGrid& grid, double x_m, double y_m, float* value) {
  const double gx = x_m / grid.resolution_m() - 0.5, gy = y_m / grid.resolution_m() - 0.5;
  const double fx = std::floor(gx), fy = std::floor(gy);
  const int ix = static_cast<int>(fx), iy = static_cast<int>(fy);
  if (!grid.contains(ix, iy) || !grid.contains(ix + 1, iy + 1)) return 0.0f;
  const std::uint32_t quad = grid.quads()[grid.quad_index(ix, iy)];
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
