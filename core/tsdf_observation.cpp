#include "core/tsdf_observation.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace knav {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

void resize(std::size_t columns, TsdfObservation* out) {
  for (std::vector<float>* field :
       {&out->direction_x, &out->direction_y, &out->range_m, &out->truncation_m, &out->free_from_m,
        &out->free_to_m, &out->clear_from_m, &out->clear_to_m, &out->inverse_truncation_per_m, &out->free_from_8_m,
        &out->free_to_8_m}) {
    field->resize(columns);
  }
  out->standing.assign(columns, 0);
  out->any_standing = false;
  out->behind_limit.assign(columns, -1.0f);
  out->any_edge = false;
  out->front_limit.assign(columns, 1.0f);
  out->any_cut = false;
}

void set_truncation(const TruncationConfig& truncation, std::size_t i, TsdfObservation* out) {
  const float r = out->range_m[i];
  out->truncation_m[i] = std::isnan(r) ? 0.0f : truncation.at(r, !out->pinhole);
  out->inverse_truncation_per_m[i] = std::isnan(r) ? 0.0f : 1.0f / out->truncation_m[i];
}

bool answered(const TsdfObservation& o, std::size_t i) {
  return !std::isnan(o.range_m[i]) || o.free_to_m[i] >= o.free_from_m[i];
}

/// How far a column's answer reaches.
float seen_to(const TsdfObservation& o, std::size_t i) {
  return std::isnan(o.range_m[i]) ? std::max(o.free_to_m[i], 0.0f) : o.range_m[i];
}

float sine_between(const TsdfObservation& o, std::size_t i, std::size_t k) {
  return std::fabs(o.direction_x[i] * o.direction_y[k] - o.direction_y[i] * o.direction_x[k]);
}

/// How many columns beside column `p`, up to `most`, have rays within `margin` of its own where that ends. They are neighbours, and
/// of a view round about not even half of it: doubling finds where they end, halving where exactly.
std::ptrdiff_t tube_columns(const TsdfObservation& o, std::ptrdiff_t p, std::ptrdiff_t step, std::ptrdiff_t most, float own, float margin) {
  const auto i = static_cast<std::size_t>(p);
  const auto within = [&](std::ptrdiff_t n) {
    const auto k = static_cast<std::size_t>(p + n * step);
    return o.direction_x[i] * o.direction_x[k] + o.direction_y[i] * o.direction_y[k] > 0.0f && own * sine_between(o, i, k) <= margin;
  };
  std::ptrdiff_t inside = 0, outside = 1;
  while (outside <= most && within(outside)) {
    inside = outside;
    outside *= 2;
  }
  outside = std::min(outside, most + 1);
  while (outside - inside > 1) {
    const std::ptrdiff_t middle = inside + (outside - inside) / 2;
    (within(middle) ? inside : outside) = middle;
  }
  return inside;
}

/// The tube of +-margin round each ray. A neighbour's answer at range r ends all tubes that it lies in.
/// Beside a column without any answer nothing is sure until the rays are a margin apart, so that a dark pole
/// between good columns is not carved away.
void set_clear(const ObservationLimits& limits, TsdfObservation* out) {
  const std::size_t n = out->columns();
  const auto margin = static_cast<float>(limits.clear_margin_m);
  for (std::size_t i = 0; i < n; ++i) {
    out->clear_from_m[i] = 0.0f;
    out->clear_to_m[i] = seen_to(*out, i);
  }
  const auto pass = [&](std::ptrdiff_t first, std::ptrdiff_t step) {
    std::ptrdiff_t blind = -1;  // the last column without an answer
    const auto count = static_cast<std::ptrdiff_t>(n);
    for (std::ptrdiff_t p = first; p >= 0 && p < count; p += step) {
      const auto i = static_cast<std::size_t>(p);
      if (!answered(*out, i)) {
        blind = p;
        continue;
      }
      if (blind >= 0) {
        const float sine = sine_between(*out, i, static_cast<std::size_t>(blind));
        out->clear_from_m[i] = std::max(out->clear_from_m[i], margin / std::max(sine, 1e-6f));
      }
      const float own = seen_to(*out, i);
      const std::ptrdiff_t most = step > 0 ? count - 1 - p : p;  // columns that way
      const std::ptrdiff_t within = tube_columns(*out, p, step, most, own, margin);
      float* const clear_to_m = out->clear_to_m.data() + (step > 0 ? p + 1 : p - within);
      for (std::ptrdiff_t k = 0; k < within; ++k) clear_to_m[k] = std::min(clear_to_m[k], own);
    }
  };
  pass(0, 1);
  pass(static_cast<std::ptrdiff_t>(n) - 1, -1);
}

/// A ray that meets a thing near its edge leaves it by its side soon. If all of the truncation behind it counted, a spur as long
/// would stand out of the thing's far corner, and close the way past it.
void set_edges(const TruncationConfig& truncation, TsdfObservation* out) {
  const auto width = static_cast<float>(truncation.edge_width_m);
  if (width <= 0.0f) return;
  const auto count = static_cast<std::ptrdiff_t>(out->columns());
  /// Column `beyond` reaches past what the columns before it, in the direction of -step, met.
  const auto mark = [&](std::ptrdiff_t last, std::ptrdiff_t beyond, std::ptrdiff_t step) {
    const auto k = static_cast<std::size_t>(beyond);
    for (std::ptrdiff_t q = last; q >= 0 && q < count; q -= step) {
      const auto i = static_cast<std::size_t>(q);
      if (!(seen_to(*out, k) > out->range_m[i] + out->truncation_m[i])) break;
      if (out->range_m[i] * sine_between(*out, i, k) > width) break;
      out->behind_limit[i] = -static_cast<float>(truncation.edge_behind);
      out->any_edge = true;
    }
  };
  std::ptrdiff_t last = -1;  // the last column that saw something
  for (std::ptrdiff_t p = 0; p < count; ++p) {
    if (!answered(*out, static_cast<std::size_t>(p))) continue;
    if (last >= 0) {
      mark(last, p, 1);
      mark(p, last, -1);
    }
    last = p;
  }
}

/// Sliding maxima and minima over 8 columns, or as many as there are left, by doubling.
void set_free_8(TsdfObservation* out) {
  const std::size_t n = out->columns();
  for (std::size_t i = 0; i < n; ++i) {
    // Rounding must not bring a cell into the support that is called free here.
    const float support = std::isnan(out->range_m[i])
                              ? out->free_to_m[i]
                              : out->range_m[i] - out->truncation_m[i] - 1e-4f * (out->range_m[i] + 1.0f);
    out->free_from_8_m[i] = out->free_from_m[i];
    out->free_to_8_m[i] = std::min(out->free_to_m[i], support);
  }
  for (const std::size_t step : {1u, 2u, 4u}) {
    for (std::size_t i = 0; i + step < n; ++i) {
      out->free_from_8_m[i] = std::max(out->free_from_8_m[i], out->free_from_8_m[i + step]);
      out->free_to_8_m[i] = std::min(out->free_to_8_m[i], out->free_to_8_m[i + step]);
    }
  }
}

void set_reach(TsdfObservation* out) {
  float reach = 0.0f;
  for (std::size_t i = 0; i < out->columns(); ++i) {
    if (!std::isnan(out->range_m[i])) reach = std::max(reach, out->range_m[i] + out->truncation_m[i]);
    if (out->free_to_m[i] >= out->free_from_m[i]) reach = std::max(reach, out->free_to_m[i]);
  }
  out->reach_m = reach;
}

}  // namespace

int TsdfObservation::valid_ranges() const {
  return static_cast<int>(
      std::count_if(range_m.begin(), range_m.end(), [](float r) { return !std::isnan(r); }));
}

void observation_from(const DepthProfile& profile, const ObservationLimits& limits, TsdfObservation* out) {
  const std::size_t n = profile.z_m.size();
  resize(n, out);
  out->stamp_s = profile.stamp_s;
  out->behind_slope = 1.0f / (1.0f - static_cast<float>(limits.truncation.behind_full));
  out->behind_power = limits.truncation.behind_power;
  out->pinhole = true;
  out->rows = profile.rows;
  out->fx_px = static_cast<float>(profile.fx_px);
  out->cx_px = static_cast<float>(profile.cx_px);
  const auto low = static_cast<float>(limits.range_min_m);
  const auto high = static_cast<float>(std::min(limits.range_max_m, profile.range_max_m));
  for (std::size_t i = 0; i < n; ++i) {
    // Column u looks along ((u - cx) / fx, 1) in (right, forward); the sensor's y axis points left.
    const float right = (static_cast<float>(i) - out->cx_px) / out->fx_px;
    const float stretch = std::sqrt(1.0f + right * right);
    out->direction_x[i] = 1.0f / stretch;
    out->direction_y[i] = -right / stretch;
    const float z = profile.z_m[i];
    out->range_m[i] =
        z >= low && z <= high ? z * stretch : kNaN;  // equation 3: the range along the ray, not z
    set_truncation(limits.truncation, i, out);
    const HeightClass height = i < profile.height_class.size() ? profile.height_class[i] : HeightClass::kMiddle;
    if (!std::isnan(out->range_m[i]) && (height == HeightClass::kLow || height == HeightClass::kHigh)) {
      out->standing[i] = -1;
      out->any_standing = true;
    }
    const float from = profile.free_from_m[i], to = std::min(profile.free_to_m[i], high);
    const bool free = from >= 0.0f && to > from;
    out->free_from_m[i] = free ? from * stretch : 0.0f;
    out->free_to_m[i] = free ? to * stretch : -1.0f;
    if (free && !std::isnan(out->range_m[i]))
      out->free_to_m[i] = std::min(out->free_to_m[i], out->range_m[i]);
    if (!free && height == HeightClass::kLow && out->standing[i] != 0 && limits.truncation.cut_front < 1.0) {
      out->front_limit[i] = static_cast<float>(limits.truncation.cut_front);
      out->any_cut = true;
    }
  }
  set_edges(limits.truncation, out);
  set_clear(limits, out);
  set_free_8(out);
  set_reach(out);
}

void observation_from(const RangeScan& scan, const ObservationLimits& limits, TsdfObservation* out) {
  const std::size_t n = scan.range_m.size();
  resize(n, out);
  out->stamp_s = scan.stamp_s;
  out->behind_slope = 1.0f / (1.0f - static_cast<float>(limits.truncation.behind_full));
  out->behind_power = limits.truncation.behind_power;
  out->pinhole = false;
  out->rows.clear();
  out->angle_min_rad = static_cast<float>(scan.angle_min_rad);
  out->angle_increment_rad = static_cast<float>(scan.angle_increment_rad);
  const auto low = static_cast<float>(std::max(limits.range_min_m, scan.range_min_m));
  const auto high = static_cast<float>(std::min(limits.range_max_m, scan.range_max_m));
  for (std::size_t i = 0; i < n; ++i) {
    const double angle = scan.angle_min_rad + scan.angle_increment_rad * static_cast<double>(i);
    out->direction_x[i] = static_cast<float>(std::cos(angle));
    out->direction_y[i] = static_cast<float>(std::sin(angle));
    const float r = scan.range_m[i];
    out->range_m[i] = r >= low && r <= high ? r : kNaN;
    set_truncation(limits.truncation, i, out);
    out->free_from_m[i] = 0.0f;
    if (std::isinf(r) && r > 0.0f) {
      const float beyond = std::min(high, static_cast<float>(limits.scan_free_beyond_m));
      out->free_to_m[i] = beyond > 0.0f ? beyond : -1.0f;
    } else {
      out->free_to_m[i] = r > high ? high : r >= low ? r : -1.0f;
    }
  }
  // No edges: half a degree apart, rays that meet one wall at a sharp angle end as far apart as those that pass an edge.
  set_clear(limits, out);
  set_free_8(out);
  set_reach(out);
}

}  // namespace knav
