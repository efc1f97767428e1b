#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "core/pose2.h"
#include "planner_tracker/map_layer.h"

namespace knav {

/// Things that came up so near to the robot that the camera never had more in view than their feet: somebody who stepped beside it
/// while it looked elsewhere. A level Kinect 0.3 m above the floor sees 0.6 m high at a distance of 0.7 m, legs, and a body is 7 cm
/// wider than they are, all round. So such a thing counts as wider until it has been seen from farther away. And what was seen from
/// farther away keeps the outline that it had then: nearer, the camera looks past a body's sides, above which it does not see.
///
/// And what is not the global map's and was seen from one side has a back, which no ray met: the local map knows nothing there, and what it
/// knows nothing of changes nothing in the global map, which says free.
class HalfSeen {
 public:
  /// @param wider_m  by so much; 0 = off  @param within_m  what is seen from farther away is seen whole
  /// @param keep_off_m  so near to the robot's middle, which is there, no cell becomes supposed
  /// @param deep_m  so deep a thing may be behind what was seen of it; 0 = off
  HalfSeen(double wider_m, double within_m, double keep_off_m, double deep_m = 0.0)
      : wider_m_(wider_m), within_m_(within_m), keep_off_m_(keep_off_m), deep_m_(deep_m) {}

  void reset(const GridGeometry& geometry);
  /// Call with every new local map, before it is laid over the global one.
  /// @param window  of the cells in `local` and `surface`, row-major; cells round what is half seen, and unknown ones at its back, become
  /// CellState::kSupposed
  void widen(const MapLayer& global, const CellWindow& window, const Pose2& T_map_robot, std::vector<CellState>* local,
             std::vector<SurfaceOffset>* surface);
  /// The same where nothing was seen at all: round each of these points a disc of this radius becomes supposed.
  void put(const std::vector<Point2>& middles, double radius_m, const CellWindow& window, const Point2& robot, std::vector<CellState>* local,
           std::vector<SurfaceOffset>* surface) const;

 private:
  using Cell = std::pair<int, int>;

  enum class Seen : std::uint8_t { kNo = 0, kWhole = 1, kOutline = 2 };
  /// Things in the window that are no wider than somebody, and not the global map's.
  enum class Thing { kWide, kHalfSeen, kWhole };

  void see(const CellWindow& window, const Pose2& T_robot_map, const std::vector<CellState>& local);
  Thing collect_thing(const CellWindow& window, std::size_t first);
  void collect_outline(const CellWindow& window, const Pose2& T_robot_map, const std::vector<CellState>& local);
  /// Round a cell, where `may_be(state)`.
  template <class MayBe>
  void occupy(int cx, int cy, double radius_m, const CellWindow& window, const Point2& robot, const MayBe& may_be,
              std::vector<CellState>* local, std::vector<SurfaceOffset>* surface) const;

  double wider_m_, within_m_, keep_off_m_, deep_m_;
  GridGeometry geometry_;
  std::vector<Seen> seen_;  ///< per cell of the map: occupied when it was in view from farther away than within_m; not far from there
  // Scratch of widen().
  std::vector<std::uint8_t> open_;   ///< per cell of the window: occupied, not the global map's, and of no thing yet
  std::vector<Cell> thing_, half_, outline_, new_;
};

}  // namespace knav
