#include "tsdf_local_mapper/view_check.h"

#include <algorithm>
#include <cmath>

namespace knav {
namespace {
constexpr std::size_t kRays = 64;
constexpr int kFewestKnown = 12;
}  // namespace

void ViewCheck::update(const TsdfGrid& grid, const TsdfObservation& o, const Pose2& T_map_sensor,
                       double dt_s) {
  const double c = std::cos(T_map_sensor.yaw_rad), s = std::sin(T_map_sensor.yaw_rad);
  const std::size_t stride = std::max<std::size_t>(1, o.columns() / kRays);
  int looked = 0, known = 0, agree = 0, through = 0, before = 0;
  for (std::size_t i = stride / 2; i < o.columns(); i += stride) {
    ++looked;
    if (std::isnan(o.range_m[i]) || o.standing[i] != 0) continue;
    const double x = o.direction_x[i], y = o.direction_y[i];
    const double map_x = c * x - s * y, map_y = s * x + c * y;
    const RayEnd end =
        cast_ray(grid, contour_, T_map_sensor.x_m, T_map_sensor.y_m, map_x, map_y, range_max_m_);
    if (end.kind != RayEnd::Kind::kSurface) continue;
    // A low box right before the camera is out of its view, and what is seen instead lies behind it.
    const int ix = grid.cell_of(T_map_sensor.x_m + map_x * end.range_m);
    const int iy = grid.cell_of(T_map_sensor.y_m + map_y * end.range_m);
    if (grid.contains(ix, iy) && grid.standing(ix, iy)) continue;
    ++known;
    const double tolerance_m = std::max(0.25, 0.75 * static_cast<double>(o.truncation_m[i]));
    const double difference_m = o.range_m[i] - end.range_m;
    if (std::fabs(difference_m) <= tolerance_m) ++agree;
    if (difference_m > tolerance_m) ++through;
    if (difference_m < -tolerance_m && o.range_m[i] > config_.carried_near_m) ++before;
  }
  agree_ = known > 0 ? static_cast<double>(agree) / known : 0.0;
  through_ = known > 0 ? static_cast<double>(through) / known : 0.0;
  const bool looks_through = known >= kFewestKnown && through_ >= config_.carried_see_through_fraction;
  const bool other_view = through + before >= config_.carried_view_fraction * looked;
  suspicious_ = (looks_through || other_view) && agree_ < config_.carried_agree_fraction;
  // Leaky, so that a good frame between bad ones does not start the count again.
  suspicious_s_ = suspicious_ ? suspicious_s_ + dt_s : std::max(0.0, suspicious_s_ - 2.0 * dt_s);
}

}  // namespace knav
