#include "planner_tracker/scan_view.h"

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

constexpr double kCell_m = 0.04;
constexpr double kUnknownCone_rad = 0.35;

}  // namespace

ScanView::ScanView(double near_m, double reach_m)
    : distance_(std::clamp(static_cast<int>(std::ceil(reach_m / kCell_m)), 1, 126)) {
  const int side = 2 * static_cast<int>(std::ceil(near_m / kCell_m));
  window_.geometry = {side, side, kCell_m, -0.5 * side * kCell_m, -0.5 * side * kCell_m};
  window_.reach_cells = distance_.reach_cells();
  window_.state.assign(window_.geometry.cell_count(), CellState::kFree);
  window_.squared_cells.assign(window_.geometry.cell_count(), distance_.cut());
}

void ScanView::clear() {
  ranges_.range_m.clear();
  ranges_.stamp_s = 0.0;
}

void ScanView::set(const RangeScan& scan, const Pose2& T_base_sensor) {
  ranges_ = scan;
  T_base_sensor_ = T_base_sensor;
}

void ScanView::place(const Pose2& T_odom_base_then, const Pose2& T_odom_base_now) {
  T_now_sensor_ = T_odom_base_now.inverse() * T_odom_base_then * T_base_sensor_;
  const GridGeometry& g = window_.geometry;
  std::fill(window_.state.begin(), window_.state.end(), CellState::kFree);
  const double near_m = -g.origin_x_m * 1.5 + std::hypot(T_now_sensor_.x_m, T_now_sensor_.y_m);
  for (std::size_t i = 0; i < ranges_.range_m.size(); ++i) {
    const double r = static_cast<double>(ranges_.range_m[i]);
    if (!(r < near_m)) continue;  // NaN and +Inf as well
    const double angle =
        T_now_sensor_.yaw_rad + ranges_.angle_min_rad + static_cast<double>(i) * ranges_.angle_increment_rad;
    const int ix = g.cell_x(T_now_sensor_.x_m + r * std::cos(angle));
    const int iy = g.cell_y(T_now_sensor_.y_m + r * std::sin(angle));
    if (g.contains(ix, iy)) window_.state[g.index(ix, iy)] = CellState::kOccupied;
  }
  // The window's edge is no wall: distances are taken a reach inside it only (see clearance_m).
  distance_.update(g.width_cells, g.height_cells, reinterpret_cast<const std::uint8_t*>(window_.state.data()),
                   static_cast<std::uint8_t>(CellState::kFree), {0, 0, g.width_cells, g.height_cells},
                   window_.squared_cells.data());
}

double ScanView::clearance_m(double x_m, double y_m) const {
  const GridGeometry& g = window_.geometry;
  const double reach = window_.reach_cells * kCell_m;
  const double edge = -g.origin_x_m - reach;
  if (std::abs(x_m) >= edge || std::abs(y_m) >= edge) return reach;
  return window_.clearance_m(x_m, y_m);
}

double ScanView::free_m(double bearing_rad, double radius_m, bool unknown_ends) const {
  if (empty()) return 0.0;
  double free = ranges_.range_max_m;
  const double c = std::cos(bearing_rad), s = std::sin(bearing_rad);
  for (std::size_t i = 0; i < ranges_.range_m.size(); ++i) {
    const double angle =
        T_now_sensor_.yaw_rad + ranges_.angle_min_rad + static_cast<double>(i) * ranges_.angle_increment_rad;
    const double r = static_cast<double>(ranges_.range_m[i]);
    if (std::isinf(r)) continue;
    if (std::isnan(r)) {
      if (unknown_ends && std::abs(normalize_angle_rad(angle - bearing_rad)) < kUnknownCone_rad) return 0.0;
      continue;
    }
    const double x = T_now_sensor_.x_m + r * std::cos(angle), y = T_now_sensor_.y_m + r * std::sin(angle);
    const double ahead = c * x + s * y, aside = std::abs(c * y - s * x);
    if (aside >= radius_m || ahead <= 0.0) continue;
    free = std::min(free, ahead - std::sqrt(radius_m * radius_m - aside * aside));
  }
  return std::max(0.0, free);
}

}  // namespace knav
