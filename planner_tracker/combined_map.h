#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/distance_map.h"
#include "core/grid_geometry.h"
#include "core/pose2.h"
#include "planner_tracker/truncated_distance.h"

namespace knav {

enum class CellState : std::uint8_t { kUnknown = 0, kFree = 1, kOccupied = 2, kKeepout = 3 };

/// The overlay rule: what the local map saw, free or occupied, is newer than the global map and overrides it;
/// what it did not see changes nothing; a keepout is never cleared.
constexpr CellState overlay(CellState global, CellState local) {
  return global == CellState::kKeepout || local == CellState::kUnknown ? global : local;
}

/// One map with the clearance of each of its cells. Only free cells are open; unknown is never free.
struct MapLayer {
  GridGeometry geometry;
  std::vector<CellState> state;
  std::vector<SurfaceOffset> surface;  ///< of cells that are not free; empty: in their middles
  std::vector<std::int16_t> squared;   ///< to the nearest cell that is not free, see TruncatedDistance
  int reach_cells = 0, units_per_cell = 1;
  /// What is taken off a clearance because the point and the surface lie anywhere in their cells [cells]: 0.5 and it is never too
  /// far; 0 and it is right in the mean.
  double surface_cells = 0.5;

  CellState at(int ix, int iy) const {
    return geometry.contains(ix, iy) ? state[geometry.index(ix, iy)] : CellState::kUnknown;
  }
  std::int16_t squared_at(int ix, int iy) const {
    return geometry.contains(ix, iy) ? squared[geometry.index(ix, iy)] : std::int16_t{0};
  }
  /// From the middle of a point's cell to the surface in the nearest cell that is not free [m]; at most about the layer's
  /// reach, 0 in cells that are not free and outside the map.
  double clearance_m(double x_m, double y_m) const {
    return clearance_of(squared_at(geometry.cell_x(x_m), geometry.cell_y(y_m)));
  }
  /// The same from the point itself, between the middles of the four cells round it.
  double smooth_clearance_m(double x_m, double y_m) const;
  double clearance_of(std::int16_t squared) const {
    return squared <= 0 ? 0.0 : (std::sqrt(static_cast<double>(squared)) / units_per_cell - surface_cells) * geometry.resolution_m;
  }
  /// Smallest `squared` whose clearance is at least this.
  int squared_for(double clearance_m) const;
  /// What `squared` is at most.
  int squared_cut() const { return (reach_cells + 1) * units_per_cell * (reach_cells + 1) * units_per_cell; }
};

/// The global map with the newest local map laid over it (paper section III.H, design section 4). Clearances are from where in their
/// cells the surfaces are, as the distance map and the local map's SurfaceCode have it: by whole cells a lane just as wide as the
/// robot needs is open in one frame's map and closed in the next.
class CombinedMap {
 public:
  /// @param reach_m clearances are exact up to this
  /// @param memory_s  how long what the local map showed occupied stays so once it is off its edge. Without it a way closed
  /// at the edge is closed and open by turns as the robot turns away from it and back.
  /// @param surface_cells  see MapLayer
  CombinedMap(double reach_m, int occupied_threshold, int free_threshold, double memory_s = 0.0, double surface_cells = 0.0);

  /// @param occupancy may be empty if `distance` is not, and the other way round; @param keepout may be
  /// empty. Both given: a cell is free only if both say so. Throws UserError if both are empty or sizes do
  /// not fit.
  void set_global(const DistanceMap& distance, const OccupancyGrid& occupancy, const OccupancyGrid& keepout);
  /// Replaces the previous local map. Clearances are recomputed round the cells that changed.
  void set_local(const OccupancyGrid& local, const Pose2& T_map_local, double now_s = 0.0);
  void clear_local();
  /// Forgets what is remembered off the local map within this distance of a point.
  void forget_round(const Point2& p, double round_m);

  bool empty() const { return global_.state.empty(); }
  const MapLayer& global() const { return global_; }  ///< with keepout, without local map
  const MapLayer& combined() const { return combined_; }
  /// What would be open if all that the local map closes went away: the global map, and where that knows nothing, what the
  /// local map saw free. Made anew by each call, over the whole map: for when there is no way.
  /// @param closed  what closes the map within `round_m` of these points stays
  const MapLayer& permissive(const std::vector<Point2>& closed = {}, double round_m = 0.0);
  /// The cells that the newest local map covers, as far as it knows anything.
  const CellWindow& local_window() const { return local_window_; }
  /// True if the newest local map knows what is there. (Off it, and where it has been reset, combined() is the global map.)
  bool seen(const Point2& p) const;
  /// Cells whose state changed in the last call.
  std::size_t changed_cells() const { return changed_cells_; }

 private:
  CellState global_state(std::int8_t value) const;
  CellState local_state(std::int8_t value) const;
  void place_surfaces(const DistanceMap& distance);
  void update_clearance(const CellWindow& window, MapLayer* layer);
  void sample_local(const OccupancyGrid& local, const Pose2& T_map_local, const CellWindow& window);
  void apply(const CellWindow& window);
  bool on_local(int ix, int iy) const;
  CellState local_cell(int ix, int iy) const;  ///< of a cell in `local_window_`
  CellState held(int ix, int iy) const;
  SurfaceOffset surface_of(int ix, int iy, CellState local) const;
  void put(int ix, int iy, CellState now, SurfaceOffset surface, CellWindow* dirty);
  void forget(CellWindow* dirty);

  double reach_m_;
  int occupied_threshold_, free_threshold_;
  MapLayer global_, combined_, permissive_;
  TruncatedDistance distance_;
  CellWindow local_window_;             ///< of the last local map
  std::vector<CellState> local_cells_;  ///< of `local_window_`, row-major
  std::vector<SurfaceOffset> local_surface_;  ///< the same
  struct Remembered {
    int ix, iy;
    double until_s;
  };
  double memory_s_, now_s_ = 0.0;
  std::vector<Remembered> remembered_;  ///< occupied cells off the local map's edge
  std::vector<std::uint8_t> is_remembered_;
  Pose2 T_local_map_;  ///< of the last local map
  GridGeometry local_geometry_{};
  std::size_t changed_cells_ = 0;
};

}  // namespace knav
