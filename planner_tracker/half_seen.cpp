#include "planner_tracker/half_seen.h"

#include <algorithm>
#include <cmath>

#include "planner_tracker/walkers.h"

namespace knav {
namespace {

constexpr double kSeesTo_m = 6.0;
constexpr double kOutlineTo_m = 2.5;    ///< from farther away an outline is wrong by centimetres
constexpr double kLookAt_m = 3.0;       ///< farther from the robot nothing is widened
constexpr double kGap_m = 0.15;         ///< between cells of one thing; as near to a surface of the global map it is that surface
constexpr double kShift_m = 0.1;        ///< a thing shifts by so much from one local map to the next
constexpr double kWidest_m = 0.8;       ///< what is wider is nobody

template <class Any>
bool any_round(const CellWindow& window, int ix, int iy, int r, const Any& any) {
  for (int y = std::max(window.y0, iy - r); y <= std::min(window.y1 - 1, iy + r); ++y) {
    for (int x = std::max(window.x0, ix - r); x <= std::min(window.x1 - 1, ix + r); ++x) {
      if (any(x, y)) return true;
    }
  }
  return false;
}

int cells(double length_m, const GridGeometry& geometry) { return static_cast<int>(std::lround(length_m / geometry.resolution_m)); }

bool not_occupied(CellState state) { return state != CellState::kOccupied; }
bool unknown(CellState state) { return state == CellState::kUnknown; }

std::size_t at(const CellWindow& window, int ix, int iy) {
  return static_cast<std::size_t>(iy - window.y0) * static_cast<std::size_t>(window.width()) + static_cast<std::size_t>(ix - window.x0);
}

}  // namespace

void HalfSeen::reset(const GridGeometry& geometry) {
  geometry_ = geometry;
  seen_.assign(wider_m_ > 0.0 || deep_m_ > 0.0 ? geometry.cell_count() : 0, Seen::kNo);
}

/// What is in view from far enough away has been seen whole; what is gone has not been seen any more.
void HalfSeen::see(const CellWindow& window, const Pose2& T_robot_map, const std::vector<CellState>& local) {
  const int gap = cells(kGap_m, geometry_);
  const auto occupied = [&](int x, int y) { return local[at(window, x, y)] == CellState::kOccupied; };
  for (int iy = window.y0; iy < window.y1; ++iy) {
    for (int ix = window.x0; ix < window.x1; ++ix) {
      Seen& seen = seen_[geometry_.index(ix, iy)];
      const CellState state = local[at(window, ix, iy)];
      const bool look = state == CellState::kOccupied ? seen != Seen::kOutline : state == CellState::kFree && seen != Seen::kNo;
      if (!look) continue;
      const Point2 p = T_robot_map * Point2{geometry_.center_x_m(ix), geometry_.center_y_m(iy)};
      if (state == CellState::kOccupied) {
        if (in_view(p, within_m_, kOutlineTo_m)) {
          seen = Seen::kOutline;
        } else if (seen == Seen::kNo && in_view(p, within_m_, kSeesTo_m)) {
          seen = Seen::kWhole;
        }
      } else if (in_view(p, within_m_, kSeesTo_m) || !any_round(window, ix, iy, gap, occupied)) {
        seen = Seen::kNo;
      }
    }
  }
}

/// Takes the cells that belong with an open one into `thing_`.
HalfSeen::Thing HalfSeen::collect_thing(const CellWindow& window, std::size_t first) {
  const int width = window.width(), shift = cells(kShift_m, geometry_), gap = cells(kGap_m, geometry_);
  thing_.assign(1, {window.x0 + static_cast<int>(first) % width, window.y0 + static_cast<int>(first) / width});
  open_[first] = 0;
  CellWindow extent;
  bool whole = false;
  for (std::size_t k = 0; k < thing_.size(); ++k) {
    const auto [ix, iy] = thing_[k];
    extent.include(ix, iy);
    whole = whole || any_round(window, ix, iy, shift, [&](int x, int y) { return seen_[geometry_.index(x, y)] != Seen::kNo; });
    any_round(window, ix, iy, gap, [&](int x, int y) {
      std::uint8_t& open = open_[at(window, x, y)];
      if (open != 0) thing_.emplace_back(x, y);
      open = 0;
      return false;
    });
  }
  if (std::max(extent.width(), extent.height()) * geometry_.resolution_m > kWidest_m) return Thing::kWide;
  return whole ? Thing::kWhole : Thing::kHalfSeen;
}

/// Cells round the thing that were its outline when it was seen whole, and are free only since the camera looks past it from near.
void HalfSeen::collect_outline(const CellWindow& window, const Pose2& T_robot_map, const std::vector<CellState>& local) {
  for (const auto& [cx, cy] : thing_) {
    any_round(window, cx, cy, cells(kGap_m, geometry_), [&](int x, int y) {
      if (seen_[geometry_.index(x, y)] != Seen::kOutline || local[at(window, x, y)] == CellState::kOccupied) return false;
      const Point2 p = T_robot_map * Point2{geometry_.center_x_m(x), geometry_.center_y_m(y)};
      if (!in_view(p, within_m_, kSeesTo_m)) outline_.emplace_back(x, y);
      return false;
    });
  }
}

void HalfSeen::widen(const MapLayer& global, const CellWindow& window, const Pose2& T_map_robot, std::vector<CellState>* local,
                     std::vector<SurfaceOffset>* surface) {
  if (seen_.empty()) return;
  const Pose2 T_robot_map = T_map_robot.inverse();
  see(window, T_robot_map, *local);
  const int look = cells(kLookAt_m, geometry_), gap = cells(kGap_m, geometry_);
  const int rx = geometry_.cell_x(T_map_robot.x_m), ry = geometry_.cell_y(T_map_robot.y_m);
  const int x0 = std::max(window.x0, rx - look), x1 = std::min(window.x1, rx + look + 1);
  const int y0 = std::max(window.y0, ry - look), y1 = std::min(window.y1, ry + look + 1);
  open_.assign(local->size(), 0);
  for (int iy = y0; iy < y1; ++iy) {
    for (int ix = x0; ix < x1; ++ix) {
      const auto mapped = [&](int x, int y) { return global.state[geometry_.index(x, y)] == CellState::kOccupied; };
      open_[at(window, ix, iy)] = (*local)[at(window, ix, iy)] == CellState::kOccupied && !any_round(window, ix, iy, gap, mapped) ? 1 : 0;
    }
  }
  half_.clear();
  outline_.clear();
  new_.clear();
  for (int iy = y0; iy < y1; ++iy) {
    for (int ix = x0; ix < x1; ++ix) {
      if (open_[at(window, ix, iy)] == 0) continue;
      const Thing thing = collect_thing(window, at(window, ix, iy));
      if (thing == Thing::kHalfSeen) half_.insert(half_.end(), thing_.begin(), thing_.end());
      if (thing == Thing::kWhole) collect_outline(window, T_robot_map, *local);
      new_.insert(new_.end(), thing_.begin(), thing_.end());
    }
  }
  const Point2 robot{T_map_robot.x_m, T_map_robot.y_m};
  if (wider_m_ > 0.0) {
    for (const auto& [cx, cy] : half_) occupy(cx, cy, wider_m_, window, robot, not_occupied, local, surface);
    for (const auto& [cx, cy] : outline_) occupy(cx, cy, 0.0, window, robot, not_occupied, local, surface);
  }
  if (deep_m_ > 0.0) {
    for (const auto& [cx, cy] : new_) occupy(cx, cy, deep_m_, window, robot, unknown, local, surface);
  }
}

void HalfSeen::put(const std::vector<Point2>& middles, double radius_m, const CellWindow& window, const Point2& robot,
                   std::vector<CellState>* local, std::vector<SurfaceOffset>* surface) const {
  for (const Point2& p : middles) {
    occupy(geometry_.cell_x(p.x_m), geometry_.cell_y(p.y_m), radius_m, window, robot, not_occupied, local, surface);
  }
}

template <class MayBe>
void HalfSeen::occupy(int cx, int cy, double radius_m, const CellWindow& window, const Point2& robot, const MayBe& may_be,
                      std::vector<CellState>* local, std::vector<SurfaceOffset>* surface) const {
  const double r = radius_m / geometry_.resolution_m + 1e-6;  // 0.3 m are six cells of 0.05
  any_round(window, cx, cy, static_cast<int>(r), [&](int x, int y) {
    const std::size_t i = at(window, x, y);
    const bool robots = std::hypot(geometry_.center_x_m(x) - robot.x_m, geometry_.center_y_m(y) - robot.y_m) < keep_off_m_;
    if (robots || std::hypot(x - cx, y - cy) > r || !may_be((*local)[i])) return false;
    (*local)[i] = CellState::kSupposed;
    (*surface)[i] = {};
    return false;
  });
}

}  // namespace knav
