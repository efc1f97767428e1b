#include "planner_tracker/combined_map.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "core/error.h"
#include "core/surface_code.h"

namespace knav {
namespace {

constexpr auto kOpen = static_cast<std::uint8_t>(CellState::kFree);

const std::uint8_t* bytes(const std::vector<CellState>& state) {
  return reinterpret_cast<const std::uint8_t*>(state.data());
}

/// Whether eight cells from `cell` on are all of this value.
bool eight_alike(const std::int8_t* cell, std::int8_t value) {
  std::uint64_t word;
  std::memcpy(&word, cell, sizeof word);
  return word == 0x0101010101010101u * static_cast<std::uint8_t>(value);
}

/// @param x, y  [cells]
SurfaceOffset offset(double x, double y, int units_per_cell) {
  const auto units = [&](double cells) { return static_cast<std::int8_t>(std::lround(std::clamp(cells, -0.5, 0.5) * units_per_cell)); };
  return {units(x), units(y)};
}

bool same_grid(const GridGeometry& a, const GridGeometry& b) {
  return a.width_cells == b.width_cells && a.height_cells == b.height_cells &&
         std::abs(a.resolution_m - b.resolution_m) < 1e-6 && std::abs(a.origin_x_m - b.origin_x_m) < 1e-3 &&
         std::abs(a.origin_y_m - b.origin_y_m) < 1e-3;
}

}  // namespace

CombinedMap::CombinedMap(double reach_m, int occupied_threshold, int free_threshold, double memory_s, double surface_cells,
                         HalfSeen half_seen)
    : reach_m_(reach_m),
      occupied_threshold_(occupied_threshold),
      free_threshold_(free_threshold),
      distance_(1),
      half_seen_(std::move(half_seen)),
      memory_s_(memory_s) {
  global_.surface_cells = surface_cells;
}

CellState CombinedMap::global_state(std::int8_t value) const {
  if (value < 0) return CellState::kUnknown;
  if (value >= occupied_threshold_) return CellState::kOccupied;
  return value <= free_threshold_ ? CellState::kFree : CellState::kUnknown;
}

CellState CombinedMap::local_state(std::int8_t value) const {
  return SurfaceCode::is_code(value) ? CellState::kFree : global_state(value);
}

void CombinedMap::set_global(const DistanceMap& distance, const OccupancyGrid& occupancy,
                             const OccupancyGrid& keepout) {
  const bool has_distance = !distance.empty(), has_occupancy = !occupancy.value.empty();
  if (!has_distance && !has_occupancy)
    throw UserError("map: neither an occupancy grid nor a distance map is given.");
  const GridGeometry geometry = has_occupancy ? occupancy.geometry : distance.geometry;
  const std::size_t cells = geometry.cell_count();
  if (!(geometry.resolution_m > 0.0) || cells == 0) throw UserError("map: it has no cells or no resolution.");
  if (has_occupancy && occupancy.value.size() != cells) throw UserError("map: not one value per cell.");
  if (has_distance && (!same_grid(distance.geometry, geometry) || distance.distance_m.size() != cells)) {
    throw UserError("distance map: its grid is not that of the map; load both from the same directory.");
  }
  if (!keepout.value.empty() && (!same_grid(keepout.geometry, geometry) || keepout.value.size() != cells)) {
    throw UserError("keepout map: its grid is not that of the map; give keepout.pgm the size of map.pgm.");
  }
  const int reach_cells =
      std::clamp(static_cast<int>(std::ceil(reach_m_ / geometry.resolution_m + 0.5)), 1, 126);
  distance_ = TruncatedDistance(reach_cells, TruncatedDistance::finest_units(reach_cells));
  global_.geometry = geometry;
  global_.reach_cells = reach_cells;
  global_.units_per_cell = distance_.units_per_cell();
  global_.state.assign(cells, CellState::kUnknown);
  for (std::size_t i = 0; i < cells; ++i) {
    CellState state = CellState::kFree;
    if (has_occupancy) state = global_state(occupancy.value[i]);
    if (has_distance && state == CellState::kFree) {
      // The contour may cut a cell that the occupancy grid calls free: within half a cell it is occupied.
      const float d = distance.distance_m[i];
      if (std::isnan(d))
        state = CellState::kUnknown;
      else if (has_occupancy ? d <= 0.0f : d < 0.5 * geometry.resolution_m)
        state = CellState::kOccupied;
    }
    if (!keepout.value.empty() && keepout.value[i] >= 50) state = CellState::kKeepout;
    global_.state[i] = state;
  }
  place_surfaces(distance);
  global_.squared.assign(cells, 0);
  update_clearance({0, 0, geometry.width_cells, geometry.height_cells}, &global_);
  combined_ = global_;
  half_seen_.reset(geometry);
  local_window_ = {};
  local_cells_.clear();
  remembered_.clear();
  is_remembered_.assign(cells, 0);
  changed_cells_ = cells;
}

/// Of the cells that a surface runs through: along the distance's gradient, where it is 0.
void CombinedMap::place_surfaces(const DistanceMap& distance) {
  const GridGeometry& g = global_.geometry;
  global_.surface.assign(g.cell_count(), {});
  if (distance.empty()) return;
  for (int iy = 1; iy + 1 < g.height_cells; ++iy) {
    for (int ix = 1; ix + 1 < g.width_cells; ++ix) {
      const std::size_t i = g.index(ix, iy);
      const float* d = distance.distance_m.data() + i;
      if (global_.state[i] != CellState::kOccupied || std::abs(*d) > g.resolution_m) continue;  // NaN is no less
      const std::ptrdiff_t row = g.width_cells;
      const double gx = 0.5 * static_cast<double>(d[1] - d[-1]), gy = 0.5 * static_cast<double>(d[row] - d[-row]);
      const double slope = gx * gx + gy * gy;
      if (!(slope > 0.1 * g.resolution_m * g.resolution_m)) continue;  // in the middle of something thin; beside the unknown
      global_.surface[i] = offset(-static_cast<double>(*d) * gx / slope, -static_cast<double>(*d) * gy / slope, distance_.units_per_cell());
    }
  }
}

void CombinedMap::update_clearance(const CellWindow& window, MapLayer* layer) {
  const GridGeometry& g = layer->geometry;
  distance_.update(g.width_cells, g.height_cells, bytes(layer->state), kOpen, layer->surface.data(), window, layer->squared.data());
}

void CombinedMap::set_local(const OccupancyGrid& local, const Pose2& T_map_local, double now_s, const Pose2& T_map_robot,
                            const std::vector<Point2>& may_stand_at) {
  if (empty() || local.value.size() != local.geometry.cell_count() || !is_finite(T_map_local)) return;
  const GridGeometry& g = global_.geometry;
  const GridGeometry& l = local.geometry;
  // The known part of the local map only: often it is a small one.
  CellWindow known;
  for (int y = 0; y < l.height_cells; ++y) {
    const std::int8_t* row = local.value.data() + l.index(0, y);
    int first = 0, last = l.width_cells;
    while (first < last && row[first] < 0) ++first;
    while (last > first && row[last - 1] < 0) --last;
    if (first < last) known = known.united({first, y, last, y + 1});
  }
  CellWindow window;
  if (!known.empty()) {
    for (const int ix : {known.x0, known.x1}) {
      for (const int iy : {known.y0, known.y1}) {
        const Point2 corner =
            T_map_local * Point2{l.origin_x_m + ix * l.resolution_m, l.origin_y_m + iy * l.resolution_m};
        window.include(g.cell_x(corner.x_m), g.cell_y(corner.y_m));
      }
    }
    window = window.clipped(g.width_cells, g.height_cells);
  }
  const CellWindow old_window = local_window_;
  local_window_ = window.empty() ? CellWindow{} : window;
  T_local_map_ = T_map_local.inverse();
  local_geometry_ = l;
  now_s_ = now_s;
  if (!window.empty()) {
    sample_local(local, T_map_local, window);
    half_seen_.widen(global_, window, T_map_robot, &local_cells_, &local_surface_);
    half_seen_.put(may_stand_at, kBody_m, window, {T_map_robot.x_m, T_map_robot.y_m}, &local_cells_, &local_surface_);
  }
  apply(old_window.united(local_window_));
}

void CombinedMap::clear_local() {
  const CellWindow old_window = local_window_;
  local_window_ = {};
  // All of the map is on an endless local map that shows nothing: nothing is remembered.
  local_geometry_ = {};
  apply(old_window);
}

void CombinedMap::sample_local(const OccupancyGrid& local, const Pose2& T_map_local,
                               const CellWindow& window) {
  const GridGeometry& g = global_.geometry;
  const GridGeometry& l = local.geometry;
  local_cells_.resize(static_cast<std::size_t>(window.width()) * static_cast<std::size_t>(window.height()));
  local_surface_.assign(local_cells_.size(), {});
  CellState by_value[256];
  for (int v = -128; v < 128; ++v) by_value[v + 128] = local_state(static_cast<std::int8_t>(v));

  // Free and unknown: each map cell asks the local cell its centre lies in; coordinates advance by constant steps
  // along a row. Occupied: each local cell marks the one map cell its surface lies in. Asked the first way as
  // well, it would mark up to four, and lanes would be a cell narrower or wider by how the local map lies; the
  // holes of one cell that this leaves in a turned wall are far narrower than any footprint. Only a map of much
  // finer cells is asked both ways: its walls would be dots.
  const bool finer = g.resolution_m < 0.75 * l.resolution_m;
  const Pose2 T_local_map = T_map_local.inverse();
  const double step = g.resolution_m / l.resolution_m;
  const double step_x = std::cos(T_local_map.yaw_rad) * step, step_y = std::sin(T_local_map.yaw_rad) * step;
  for (int iy = window.y0; iy < window.y1; ++iy) {
    const Point2 first = T_local_map * Point2{g.center_x_m(window.x0), g.center_y_m(iy)};
    double x = (first.x_m - l.origin_x_m) / l.resolution_m, y = (first.y_m - l.origin_y_m) / l.resolution_m;
    CellState* out = local_cells_.data() +
                     static_cast<std::size_t>(iy - window.y0) * static_cast<std::size_t>(window.width());
    for (int i = 0; i < window.width(); ++i, x += step_x, y += step_y) {
      const bool inside = x >= 0.0 && y >= 0.0 && x < l.width_cells && y < l.height_cells;
      const CellState state = inside ? by_value[local.value[l.index(static_cast<int>(x), static_cast<int>(y))] + 128]
                                     : CellState::kUnknown;
      out[i] = state == CellState::kOccupied && !finer ? CellState::kFree : state;
    }
  }
  const double c = std::cos(T_map_local.yaw_rad), s = std::sin(T_map_local.yaw_rad);
  for (int iy = 0; iy < l.height_cells; ++iy) {
    const std::int8_t* const row = local.value.data() + l.index(0, iy);
    for (int ix = 0; ix < l.width_cells; ++ix) {
      if (by_value[row[ix] + 128] != CellState::kOccupied) {
        if (ix + 8 <= l.width_cells && eight_alike(row + ix, row[ix])) ix += 7;  // most of the map
        continue;
      }
      const Point2 in_cell = surface_in_cell(local, ix, iy);
      const double lx = l.center_x_m(ix) + in_cell.x_m * l.resolution_m, ly = l.center_y_m(iy) + in_cell.y_m * l.resolution_m;
      const double mx = T_map_local.x_m + c * lx - s * ly, my = T_map_local.y_m + s * lx + c * ly;
      const int gx = g.cell_x(mx), gy = g.cell_y(my);
      if (gx < window.x0 || gy < window.y0 || gx >= window.x1 || gy >= window.y1) continue;
      const std::size_t i = static_cast<std::size_t>(gy - window.y0) * static_cast<std::size_t>(window.width()) +
                            static_cast<std::size_t>(gx - window.x0);
      local_cells_[i] = CellState::kOccupied;
      local_surface_[i] = offset((mx - g.center_x_m(gx)) / g.resolution_m, (my - g.center_y_m(gy)) / g.resolution_m, distance_.units_per_cell());
    }
  }
}

const MapLayer& CombinedMap::permissive(const std::vector<Point2>& closed, double round_m) {
  permissive_.geometry = global_.geometry;
  permissive_.reach_cells = global_.reach_cells;
  permissive_.units_per_cell = global_.units_per_cell;
  permissive_.surface_cells = global_.surface_cells;
  permissive_.surface = combined_.surface;
  permissive_.state.resize(global_.state.size());
  permissive_.squared.resize(global_.state.size());
  for (std::size_t i = 0; i < global_.state.size(); ++i) {
    const bool newly_free = global_.state[i] == CellState::kUnknown && combined_.state[i] == CellState::kFree;
    permissive_.state[i] = newly_free ? CellState::kFree : global_.state[i];
  }
  const GridGeometry& g = global_.geometry;
  const int r = static_cast<int>(round_m / g.resolution_m);
  for (const Point2& p : closed) {
    const int cx = g.cell_x(p.x_m), cy = g.cell_y(p.y_m);
    for (int dy = -r; dy <= r; ++dy) {
      for (int dx = -r; dx <= r; ++dx) {
        if (dx * dx + dy * dy > r * r || combined_.at(cx + dx, cy + dy) == CellState::kFree || !g.contains(cx + dx, cy + dy)) continue;
        const std::size_t i = g.index(cx + dx, cy + dy);
        permissive_.state[i] = combined_.state[i];
      }
    }
  }
  update_clearance({0, 0, g.width_cells, g.height_cells}, &permissive_);
  return permissive_;
}

bool CombinedMap::seen(const Point2& p) const {
  const int ix = global_.geometry.cell_x(p.x_m), iy = global_.geometry.cell_y(p.y_m);
  const CellWindow& w = local_window_;
  return !w.empty() && ix >= w.x0 && ix < w.x1 && iy >= w.y0 && iy < w.y1 && local_cell(ix, iy) != CellState::kUnknown;
}

CellState CombinedMap::local_cell(int ix, int iy) const {
  return local_cells_[static_cast<std::size_t>(iy - local_window_.y0) * static_cast<std::size_t>(local_window_.width()) +
                      static_cast<std::size_t>(ix - local_window_.x0)];
}

bool CombinedMap::on_local(int ix, int iy) const {
  if (local_geometry_.width_cells == 0) return true;
  const Point2 p = T_local_map_ * Point2{global_.geometry.center_x_m(ix), global_.geometry.center_y_m(iy)};
  return local_geometry_.contains(local_geometry_.cell_x(p.x_m), local_geometry_.cell_y(p.y_m));
}

/// What the local map shows of a cell, or showed before the cell went off its edge.
CellState CombinedMap::held(int ix, int iy) const {
  const CellWindow& w = local_window_;
  CellState local = CellState::kUnknown;
  if (!w.empty() && ix >= w.x0 && ix < w.x1 && iy >= w.y0 && iy < w.y1) {
    local = local_cell(ix, iy);
  }
  const std::size_t i = global_.geometry.index(ix, iy);
  const bool showed = combined_.state[i] == CellState::kOccupied && global_.state[i] != CellState::kOccupied;
  return memory_s_ > 0.0 && showed && local == CellState::kUnknown && !on_local(ix, iy) ? CellState::kOccupied : local;
}

/// Where the surface is in a cell that is not free, whoever says that it is not.
SurfaceOffset CombinedMap::surface_of(int ix, int iy, CellState local) const {
  const CellWindow& w = local_window_;
  const std::size_t i = global_.geometry.index(ix, iy);
  if (local != CellState::kOccupied || global_.state[i] == CellState::kKeepout) return global_.surface[i];
  const bool shown = !w.empty() && ix >= w.x0 && ix < w.x1 && iy >= w.y0 && iy < w.y1 && local_cell(ix, iy) == CellState::kOccupied;
  if (!shown) return combined_.surface[i];  // remembered
  return local_surface_[static_cast<std::size_t>(iy - w.y0) * static_cast<std::size_t>(w.width()) + static_cast<std::size_t>(ix - w.x0)];
}

void CombinedMap::put(int ix, int iy, CellState now, SurfaceOffset surface, CellWindow* dirty) {
  const std::size_t i = global_.geometry.index(ix, iy);
  if (combined_.surface[i] != surface) {
    combined_.surface[i] = surface;
    if (now != CellState::kFree) dirty->include(ix, iy);
  }
  if (now == combined_.state[i]) return;
  // Only a change between open and not open moves clearances.
  if ((now == CellState::kFree) != (combined_.state[i] == CellState::kFree)) dirty->include(ix, iy);
  combined_.state[i] = now;
  ++changed_cells_;
}

/// What has been off the edge for too long is forgotten, and what is on the local map again is the local map's to say.
void CombinedMap::forget(CellWindow* dirty) {
  std::size_t kept = 0;
  for (const Remembered& r : remembered_) {
    if (now_s_ < r.until_s && now_s_ >= r.until_s - memory_s_ && !on_local(r.ix, r.iy)) {
      remembered_[kept++] = r;
      continue;
    }
    const std::size_t i = global_.geometry.index(r.ix, r.iy);
    is_remembered_[i] = 0;
    put(r.ix, r.iy, global_.state[i], global_.surface[i], dirty);
  }
  remembered_.resize(kept);
}

void CombinedMap::forget_round(const Point2& p, double round_m) {
  for (Remembered& r : remembered_) {
    if (std::hypot(global_.geometry.center_x_m(r.ix) - p.x_m, global_.geometry.center_y_m(r.iy) - p.y_m) <= round_m) r.until_s = now_s_;
  }
  apply({});
}

void CombinedMap::apply(const CellWindow& window) {
  changed_cells_ = 0;
  CellWindow dirty;
  forget(&dirty);
  for (int iy = window.y0; iy < window.y1; ++iy) {
    for (int ix = window.x0; ix < window.x1; ++ix) {
      const std::size_t i = global_.geometry.index(ix, iy);
      if (is_remembered_[i] != 0) continue;
      const CellState local = held(ix, iy);
      put(ix, iy, overlay(global_.state[i], local), surface_of(ix, iy, local), &dirty);
      if (memory_s_ > 0.0 && local == CellState::kOccupied && combined_.state[i] == CellState::kOccupied &&
          global_.state[i] != CellState::kOccupied && !on_local(ix, iy)) {
        is_remembered_[i] = 1;
        remembered_.push_back({ix, iy, now_s_ + memory_s_});
      }
    }
  }
  if (dirty.empty()) return;
  update_clearance(dirty.grown(distance_.reach_cells() + 1), &combined_);
}

}  // namespace knav
