#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/distance_map.h"
#include "core/grid_geometry.h"
#include "core/pose2.h"
#include "planner_tracker/half_seen.h"
#include "planner_tracker/map_layer.h"
#include "planner_tracker/truncated_distance.h"

namespace knav {

/// The overlay rule: what the local map saw, free or occupied, is newer than the global map and overrides it;
/// what it did not see changes nothing; a keepout is never cleared.
constexpr CellState overlay(CellState global, CellState local) {
  return global == CellState::kKeepout || local == CellState::kUnknown ? global : local;
}

/// The global map with the newest local map laid over it (paper section III.H, design section 4). Clearances are from where in their
/// cells the surfaces are, as the distance map and the local map's SurfaceCode have it: by whole cells a lane just as wide as the
/// robot needs is open in one frame's map and closed in the next.
class CombinedMap {
 public:
  /// @param reach_m clearances are exact up to this
  /// @param memory_s  how long what the local map showed occupied stays so once it is off its edge. Without it a way closed
  /// at the edge is closed and open by turns as the robot turns away from it and back.
  /// @param surface_cells  see MapLayer
  /// @param half_seen  where somebody may be of whom less is seen; by default nowhere
  CombinedMap(double reach_m, int occupied_threshold, int free_threshold, double memory_s = 0.0, double surface_cells = 0.0,
              HalfSeen half_seen = {0.0, 0.0, 0.0});

  /// @param occupancy may be empty if `distance` is not, and the other way round; @param keepout may be
  /// empty. Both given: a cell is free only if both say so. Throws UserError if both are empty or sizes do
  /// not fit.
  void set_global(const DistanceMap& distance, const OccupancyGrid& occupancy, const OccupancyGrid& keepout);
  /// Replaces the previous local map. Clearances are recomputed round the cells that changed.
  /// @param T_map_robot  where the robot is, for what is half seen @param may_stand_at  see Walkers
  void set_local(const OccupancyGrid& local, const Pose2& T_map_local, double now_s = 0.0, const Pose2& T_map_robot = {},
                 const std::vector<Point2>& may_stand_at = {});
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
  HalfSeen half_seen_;
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
