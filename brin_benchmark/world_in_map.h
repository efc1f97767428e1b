#pragma once

#include <map>
#include <mutex>
#include <utility>
#include <vector>

#include "core/pose2.h"
#include "global_map_builder/map_directory.h"
#include "kinect_sim/world.h"

namespace knav {

/// Where a place of a building is in a map of it. A map bends: far from where its drive began it is some decimetres off. Who paints
/// a keepout on it, or sends a robot somewhere by it, goes by the walls that he sees round that place; so does this.
class WorldInMap {
 public:
  /// @param T_world_map  the map's frame in the building, right where the drive began
  WorldInMap(const WorldConfig& world, const MapDirectory& map, const Pose2& T_world_map);

  /// The building's frame in the map, as the walls within 6 m of a point of the building have it.
  const Pose2& T_map_world(const Point2& in_world) const;
  Point2 in_world(const Point2& in_map) const { return T_map_world(T_map_world_.inverse() * in_map).inverse() * in_map; }
  Point2 operator*(const Point2& in_world) const { return T_map_world(in_world) * in_world; }
  Pose2 operator*(const Pose2& T_world_x) const { return T_map_world({T_world_x.x_m, T_world_x.y_m}) * T_world_x; }

 private:
  Pose2 align(const Point2& around) const;
  double misfit(const std::vector<Point2>& walls, const Pose2& T_map_world) const;

  Pose2 T_map_world_;
  GridGeometry geometry_;
  std::vector<float> to_wall_m_;     ///< of the map's cells
  std::vector<Point2> walls_;        ///< points of the building's outlines, one in 10 cm
  mutable std::mutex mutex_;
  mutable std::map<std::pair<int, int>, Pose2> near_;  ///< found so far, by squares; runs ask from their own threads
};

}  // namespace knav
