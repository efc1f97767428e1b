#include "planner_tracker/scan_view.h"

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

constexpr double kCell_m = 0.04;
constexpr double kUnknownCone_rad = 0.35;
/// Up to here a clearance decides whether the robot fits, and 2 to 4 cm lost to the cells would close a lane to it.
constexpr double kExact_m = 0.5;

}  // namespace

ScanView::ScanView(double near_m, double reach_m)
    : distance_(std::clamp(static_cast<int>(std::ceil(reach_m / kCell_m)), 1, 126)) {
  const int side = 2 * static_cast<int>(std::ceil(near_m / kCell_m));
  window_.geometry = {side, side, kCell_m, -0.5 * side * kCell_m, -0.5 * side * kCell_m};
  window_.reach_cells = distance_.reach_cells();
  window_.state.assign(window_.geometry.cell_count(), CellState::kFree);
  window_.squared.assign(window_.geometry.cell_count(), distance_.cut());
  first_.assign(window_.geometry.cell_count() + 1, 0);
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
  returns_.clear();
  cell_.clear();
  const double near_m = -g.origin_x_m * 1.5 + std::hypot(T_now_sensor_.x_m, T_now_sensor_.y_m);
  for (std::size_t i = 0; i < ranges_.range_m.size(); ++i) {
    const double r = static_cast<double>(ranges_.range_m[i]);
    if (!(r < near_m)) continue;  // NaN and +Inf as well
    const double angle =
        T_now_sensor_.yaw_rad + ranges_.angle_min_rad + static_cast<double>(i) * ranges_.angle_increment_rad;
    const Point2 p{T_now_sensor_.x_m + r * std::cos(angle), T_now_sensor_.y_m + r * std::sin(angle)};
    const int ix = g.cell_x(p.x_m), iy = g.cell_y(p.y_m);
    if (!g.contains(ix, iy)) continue;
    window_.state[g.index(ix, iy)] = CellState::kOccupied;
    returns_.push_back(p);
    cell_.push_back(g.index(ix, iy));
  }
  sort_returns();
  // The window's edge is no wall: distances are taken a reach inside it only (see clearance_m).
  distance_.update(g.width_cells, g.height_cells, reinterpret_cast<const std::uint8_t*>(window_.state.data()),
                   static_cast<std::uint8_t>(CellState::kFree), nullptr, {0, 0, g.width_cells, g.height_cells},
                   window_.squared.data());
}

void ScanView::sort_returns() {
  std::fill(first_.begin(), first_.end(), 0);
  for (const std::size_t i : cell_) ++first_[i + 1];
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  sorted_.resize(returns_.size());
  // This leaves each cell's first where the next one's is.
  for (std::size_t k = 0; k < returns_.size(); ++k) sorted_[first_[cell_[k]]++] = returns_[k];
  for (std::size_t i = first_.size() - 1; i > 0; --i) first_[i] = first_[i - 1];
  first_[0] = 0;
}

double ScanView::exact_clearance_m(double x_m, double y_m, double most_m) const {
  const GridGeometry& g = window_.geometry;
  const int x0 = std::max(0, g.cell_x(x_m - most_m)), x1 = std::min(g.width_cells - 1, g.cell_x(x_m + most_m));
  const int y0 = std::max(0, g.cell_y(y_m - most_m)), y1 = std::min(g.height_cells - 1, g.cell_y(y_m + most_m));
  double nearest2 = most_m * most_m;
  for (int iy = y0; iy <= y1; ++iy) {
    // The cells of a row lie one after the other, and so do their returns.
    const std::size_t end = first_[g.index(x1, iy) + 1];
    for (std::size_t k = first_[g.index(x0, iy)]; k < end; ++k) {
      const double dx = sorted_[k].x_m - x_m, dy = sorted_[k].y_m - y_m;
      nearest2 = std::min(nearest2, dx * dx + dy * dy);
    }
  }
  return std::sqrt(nearest2);
}

double ScanView::clearance_m(double x_m, double y_m) const {
  const GridGeometry& g = window_.geometry;
  const double reach = window_.reach_cells * kCell_m;
  const double edge = -g.origin_x_m - reach;
  if (std::abs(x_m) >= edge || std::abs(y_m) >= edge) return reach;
  const double by_cells = window_.clearance_m(x_m, y_m);
  if (by_cells > kExact_m) return by_cells;
  return exact_clearance_m(x_m, y_m, by_cells + 2.0 * kCell_m);  // the point and the return lie anywhere in their cells
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
