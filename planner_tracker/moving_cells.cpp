#include "planner_tracker/moving_cells.h"

#include <cmath>
#include <utility>

namespace knav {
namespace {

constexpr float kNever = -1e9f;
/// Seen occupied this lately still stands there: a contour flickers.
constexpr double kStillThere_s = 2.0;
constexpr float kPassed_s = 3.0f;     ///< who walks is in one place for no longer
constexpr int kBeside_cells = 8;      ///< of a trail: a contour that shifts stays nearer to what it is of

}  // namespace

void MovingCells::reset(const MapLayer& layer) {
  geometry_ = layer.geometry;
  const std::size_t cells = geometry_.cell_count();
  occupied_from_s_.assign(cells, kNever);
  occupied_to_s_.assign(cells, kNever);
  occupied_near_s_.assign(cells, kNever);
  points_.clear();
  trail_.clear();
  begin_s_ = -1.0;
}

bool MovingCells::stood_near(const MapLayer& global, int ix, int iy, double now_s) const {
  for (int dy = -kShift_cells; dy <= kShift_cells; ++dy) {
    for (int dx = -kShift_cells; dx <= kShift_cells; ++dx) {
      if (!geometry_.contains(ix + dx, iy + dy)) continue;
      const std::size_t i = geometry_.index(ix + dx, iy + dy);
      if (global.state[i] == CellState::kOccupied) return true;
      const double from_s = static_cast<double>(occupied_from_s_[i]), to_s = static_cast<double>(occupied_to_s_[i]);
      if (from_s + begin_s_ < now_s - kFresh_s && to_s + begin_s_ > now_s - kStillThere_s) return true;
    }
  }
  return false;
}

bool MovingCells::is_trail(const MapLayer& global, const MapLayer& combined, int ix, int iy, float now) const {
  const std::size_t i = geometry_.index(ix, iy);
  if (now - occupied_near_s_[i] > static_cast<float>(kTrail_s) || occupied_to_s_[i] - occupied_from_s_[i] > kPassed_s || global.state[i] != CellState::kFree) return false;
  for (int dy = -kBeside_cells; dy <= kBeside_cells; ++dy) {
    for (int dx = -kBeside_cells; dx <= kBeside_cells; ++dx) {
      if (combined.at(ix + dx, iy + dy) == CellState::kOccupied) return false;
    }
  }
  return true;
}

void MovingCells::update(const MapLayer& global, const MapLayer& combined, const CellWindow& window, const Point2& robot, double now_s) {
  points_.clear();
  trail_.clear();
  if (geometry_.cell_count() != combined.state.size() || now_s < 0.0) return;
  if (begin_s_ < 0.0 || now_s < begin_s_) {
    reset(combined);
    begin_s_ = now_s;
  }
  const float now = static_cast<float>(now_s - begin_s_);
  std::vector<std::pair<int, int>> fresh;
  for (int iy = window.y0; iy < window.y1; ++iy) {
    for (int ix = window.x0; ix < window.x1; ++ix) {
      const std::size_t i = geometry_.index(ix, iy);
      const bool left = combined.state[i] == CellState::kFree || combined.state[i] == CellState::kSupposed;
      if (left && is_trail(global, combined, ix, iy, now)) trail_.push_back({geometry_.center_x_m(ix), geometry_.center_y_m(iy)});
      if (combined.state[i] != CellState::kOccupied) continue;
      if (now - occupied_to_s_[i] > static_cast<float>(kStillThere_s)) occupied_from_s_[i] = now;
      occupied_to_s_[i] = now;
      if (std::hypot(geometry_.center_x_m(ix) - robot.x_m, geometry_.center_y_m(iy) - robot.y_m) < kTrailWithin_m) occupied_near_s_[i] = now;
      const bool just = now - occupied_from_s_[i] < static_cast<float>(kFresh_s);
      if (just && global.state[i] == CellState::kFree) fresh.emplace_back(ix, iy);
    }
  }
  for (const auto& [ix, iy] : fresh) {
    if (!stood_near(global, ix, iy, now_s)) points_.push_back({geometry_.center_x_m(ix), geometry_.center_y_m(iy)});
  }
  if (points_.size() < kFewest) points_.clear();
  if (trail_.size() < kFewest) trail_.clear();
}

}  // namespace knav
