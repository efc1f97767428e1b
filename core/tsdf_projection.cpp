#include "core/tsdf_projection.h"

#include <algorithm>
#include <cmath>

#include "core/multiversion.h"
#include "core/pose2.h"

namespace knav {
namespace {

struct Span {
  double low, high;
};

/// Where in [low, high] a dx + b >= 0.
Span clipped(double low, double high, double a, double b) {
  Span span{low, high};
  if (a > 1e-9) {
    span.low = std::max(span.low, -b / a);
  } else if (a < -1e-9) {
    span.high = std::min(span.high, -b / a);
  } else if (b < -1e-6) {
    span.high = span.low - 1.0;
  }
  return span;
}

}  // namespace

KNAV_MULTIVERSION
void project_row_pinhole(const TsdfRowProjection& p, int first, int count, std::int32_t* column,
                         float* distance_m) {
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
    distance_m[k] = std::sqrt(dx * dx + p.dy * p.dy);
  }
}

// atan2 to about 1e-5 rad of every cell of the row, in passes without branches, which the compiler turns into vector
// code.
KNAV_MULTIVERSION
void project_row_angular(const TsdfRowProjection& p, int first, int count, std::int32_t* column, float* distance_m,
                         float* angle_rad) {
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
    angle_rad[k] = std::copysign(half, y);
    distance_m[k] = std::sqrt(dx * dx + p.dy * p.dy);
  }
  const auto columns = static_cast<float>(p.columns);
  const float turn = 6.28318530718f * std::fabs(p.column_scale);
  for (int k = 0; k < count; ++k) {
    float u = p.column_shift + p.column_scale * angle_rad[k];
    u += turn * (static_cast<float>(u < 0.0f) -
                 static_cast<float>(u >= turn));  // it may start anywhere on the circle
    u = u < -1.0f ? -1.0f : u;
    u = u > columns ? columns : u;
    const bool seen = u >= 0.0f && u < columns;
    column[k] = seen ? static_cast<std::int32_t>(u) : -1;
  }
}

TsdfView::TsdfView(const TsdfObservation& o) {
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
  all_round_ = left - right >= 2.0 * kPi - 0.02;
  narrow_ = left - right <= kPi;
  right_x_ = std::cos(right);
  right_y_ = std::sin(right);
  left_x_ = std::cos(left);
  left_y_ = std::sin(left);
}

bool TsdfView::span(double dy_m, double within_m, double* low_m, double* high_m) const {
  const double square = within_m * within_m - dy_m * dy_m;
  if (square <= 0.0) return false;
  *high_m = std::sqrt(square);
  *low_m = -*high_m;
  if (all_round_) return true;
  // The half planes left of the right edge and right of the left edge: a narrow view is their intersection, a wide one
  // their union.
  const Span r = clipped(*low_m, *high_m, -right_y_, right_x_ * dy_m);
  const Span l = clipped(*low_m, *high_m, left_y_, -left_x_ * dy_m);
  if (narrow_) {
    *low_m = std::max(r.low, l.low);
    *high_m = std::min(r.high, l.high);
  } else {
    const bool r_empty = r.low > r.high, l_empty = l.low > l.high;
    if (r_empty && l_empty) return false;
    *low_m = r_empty ? l.low : l_empty ? r.low : std::min(r.low, l.low);
    *high_m = r_empty ? l.high : l_empty ? r.high : std::max(r.high, l.high);
  }
  return *low_m <= *high_m;
}

}  // namespace knav
