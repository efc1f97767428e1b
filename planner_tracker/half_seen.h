#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "core/pose2.h"
#include "planner_tracker/map_layer.h"

namespace knav {

/// Things that came up so near to the robot that the camera never had more in view than their feet: somebody who stepped beside it
/// while it looked elsewhere. A level Kinect 0.3 m above the floor sees 0.6 m high at a distance of 0.7 m, legs, and a body is 7 cm
/// wider than they are, all round. So such a thing counts as wider until it has been seen from farther away.
class HalfSeen {
 public:
  /// @param wider_m  by so much; 0 = off  @param within_m  what is seen from farther away is seen whole
  /// @param keep_off_m  so near to the robot's middle, which is there, no cell becomes occupied
  HalfSeen(double wider_m, double within_m, double keep_off_m) : wider_m_(wider_m), within_m_(within_m), keep_off_m_(keep_off_m) {}

  void reset(const GridGeometry& geometry);
  /// Call with every new local map, before it is laid over the global one.
  /// @param window  of the cells in `local` and `surface`, row-major; cells round what is half seen become occupied
  void widen(const MapLayer& global, const CellWindow& window, const Pose2& T_map_robot, std::vector<CellState>* local,
             std::vector<SurfaceOffset>* surface);
  /// The same where nothing was seen at all: round each of these points a disc of this radius becomes occupied.
  void put(const std::vector<Point2>& middles, double radius_m, const CellWindow& window, const Point2& robot, std::vector<CellState>* local,
           std::vector<SurfaceOffset>* surface) const;

 private:
  using Cell = std::pair<int, int>;

  void see(const CellWindow& window, const Pose2& T_map_robot, const std::vector<CellState>& local);
  bool collect_thing(const CellWindow& window, std::size_t first);
  void occupy(int cx, int cy, double radius_m, const CellWindow& window, const Point2& robot, std::vector<CellState>* local,
              std::vector<SurfaceOffset>* surface) const;

  double wider_m_, within_m_, keep_off_m_;
  GridGeometry geometry_;
  std::vector<std::uint8_t> whole_;  ///< per cell of the map: occupied when it was in view from farther away than within_m
  // Scratch of widen().
  std::vector<std::uint8_t> open_;   ///< per cell of the window: occupied, not the global map's, and of no thing yet
  std::vector<Cell> thing_, half_;
};

}  // namespace knav
