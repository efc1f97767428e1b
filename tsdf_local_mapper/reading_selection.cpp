#include "tsdf_local_mapper/reading_selection.h"

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

constexpr float kFree = 0.9f;               ///< F of cells that no surface is near
constexpr double kOdometryMayMove_m = 0.3;  ///< a reading by so much, which is less than the truncation, ...
constexpr double kSds = 8.0;                ///< ... at so many standard deviations of a step: its errors add up over some
constexpr double kChanged_s = 5.0;          ///< ago a cell forgot what it held
constexpr double kSeen_s = 1.0;             ///< a cell, for what is in it to be there for certain
constexpr std::size_t kSurfaceColumns = 6;  ///< to either side of a reading, whose points give its surface's direction

}  // namespace

/// A depth camera's steady errors are along the ray and grow with range: 2 % at 10 m, 4 % at 20 m after a calibration. On
/// a far wall seen square they pull the robot along as it drives up to it; on one seen at a sharp angle they move the
/// reading along the wall, which changes nothing, and that is where the heading comes from.
float ReadingSelection::weight_of(const TsdfObservation& o, std::size_t column) const {
  if (!o.pinhole) return 1.0f;
  if (!o.rows.empty() && o.rows[column] < config_.thin_rows) return 0.0f;
  if (config_.depth_trust_m <= 0.0) return 1.0f;
  float across = 1.0f;  // sine of the angle between ray and surface
  if (column >= kSurfaceColumns && column + kSurfaceColumns < o.columns()) {
    const std::size_t left = column - kSurfaceColumns, right = column + kSurfaceColumns;
    const float dx = o.direction_x[right] * o.range_m[right] - o.direction_x[left] * o.range_m[left];
    const float dy = o.direction_y[right] * o.range_m[right] - o.direction_y[left] * o.range_m[left];
    const float length = std::hypot(dx, dy);
    if (length > 0.0f) across = std::fabs(o.direction_x[column] * dy - o.direction_y[column] * dx) / length;
    if (!(across <= 1.0f)) across = 1.0f;  // a neighbour without a reading
  }
  const float ratio = o.range_m[column] * across / static_cast<float>(config_.depth_trust_m);
  return 1.0f / (1.0f + ratio * ratio);
}

/// How near a reading must be to be taken for somebody who moves: farther off it may be odometry that is wrong.
double ReadingSelection::moving_range_m(const Pose2& T_step) const {
  const double turn_rad = kSds * motion_noise(motion_, T_step).turn_rad;
  return std::min(config_.moving_range_m, kOdometryMayMove_m / std::max(1e-6, turn_rad));
}

WeightedPoints& ReadingSelection::select(const TsdfObservation& o, const Pose2& T_base_sensor, const TsdfGrid& grid,
                                         std::uint32_t next_sequence, const Pose2& T_local_before, const Pose2& T_step,
                                         double dt_s) {
  points_.clear();
  doubtful_.clear();
  const int valid = o.valid_ranges();
  const double stride = std::max(1.0, static_cast<double>(valid) / config_.readings);
  const double c = std::cos(T_base_sensor.yaw_rad), s = std::sin(T_base_sensor.yaw_rad);
  const Pose2 T_local_base = T_local_before * T_step;
  const double near_m = moving_range_m(T_step);
  double next = 0.5 * stride;
  int seen = 0;
  for (std::size_t i = 0; i < o.columns(); ++i) {
    if (std::isnan(o.range_m[i]) || o.cut(i)) continue;
    if (++seen < next) continue;
    next += stride;
    const double x = o.direction_x[i] * o.range_m[i], y = o.direction_y[i] * o.range_m[i];
    const Pose2 T_base_reading{T_base_sensor.x_m + c * x - s * y, T_base_sensor.y_m + s * x + c * y, 0.0};
    const Come come = o.range_m[i] < near_m ? has_come(grid, next_sequence, T_local_base * T_base_reading, o.range_m[i], dt_s) : Come::kNo;
    if (come == Come::kYes) continue;
    WeightedPoints& list = come == Come::kPerhaps ? doubtful_ : points_;
    list.add(static_cast<float>(T_base_reading.x_m), static_cast<float>(T_base_reading.y_m), weight_of(o, i));
  }
  // Where most of what is near is new, the robot turns in a small room.
  if (doubtful_.size() > points_.size()) {
    for (std::size_t k = 0; k < doubtful_.size(); ++k)
      points_.add(doubtful_.x_m[k], doubtful_.y_m[k], doubtful_.weight[k]);
  }
  coverage_ = static_cast<double>(points_.size()) * stride / static_cast<double>(std::max<std::size_t>(1, o.columns()));
  return points_;
}

/// Has what is seen at a point of the local map, at a range, just come there? It has if the cell is known to be free, or has
/// forgotten what it held only some seconds ago. It may have if the cell has not been seen for long (equation 4: a frame weighs
/// 1 / range^2).
ReadingSelection::Come ReadingSelection::has_come(const TsdfGrid& grid, std::uint32_t next_sequence, const Pose2& T_local_point,
                                                  double range_m, double dt_s) {
  const int ix = grid.cell_of(T_local_point.x_m), iy = grid.cell_of(T_local_point.y_m);
  if (!grid.contains(ix, iy) || !grid.known(ix, iy)) return Come::kNo;
  const std::uint32_t since = grid.reset_sequence(ix, iy);
  const bool changed = since > 0 && (next_sequence - since) * dt_s < kChanged_s;
  if (changed || grid.distance(ix, iy) >= kFree) return Come::kYes;
  return grid.weight(ix, iy) * range_m * range_m * dt_s < kSeen_s ? Come::kPerhaps : Come::kNo;
}

}  // namespace knav
