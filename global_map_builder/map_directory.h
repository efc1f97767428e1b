#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "core/distance_map.h"
#include "core/grid_geometry.h"
#include "core/pose2.h"
#include "core/trajectory.h"

namespace knav {

/// A map as it lies on disk, in the frame `map`. All grids share one geometry.
///
///   map.yaml, map.pgm   map_server's own format      distance.tiff  float32 metres, signed, NaN = unknown
///   keepout.pgm         black = never drive there     places.yaml    NAME: {x_m: , y_m: , yaw_rad: }
///   trajectory.tum      of the mapping drive          metadata.yaml  version, checksums, how it was made
struct MapDirectory {
  OccupancyGrid occupancy;              ///< 0 free, 100 occupied, -1 unknown
  DistanceMap distance;                 ///< its checksum is that of the map
  OccupancyGrid keepout;                ///< 100 = keep out, 0 elsewhere; all 0 if there is no keepout.pgm
  std::map<std::string, Pose2> places;  ///< T_map_robot of named goals
  Trajectory trajectory;                ///< may be empty
  std::string checksum;                 ///< 16 hex digits over occupancy, distance and geometry
  std::map<std::string, std::string> about;  ///< free text from metadata.yaml: how the map was made
  std::vector<std::string> warnings;         ///< of load_map, e.g. that map.pgm was edited by hand
};

/// Reads a map directory, or a plain map_server map by its YAML file (modes trinary, scale, raw). A map
/// without distance.tiff, or whose map.pgm was edited since, gets its distance map from the occupied cells.
/// UserError names the file at fault.
MapDirectory load_map(const std::string& path);

/// Writes all files beside `directory`, then renames: readers see the old map or the whole new one. An
/// existing map is replaced, but a directory that holds anything else is refused (UserError), and so is,
/// unless `force`, a map whose keepout.pgm or places.yaml were edited by hand.
/// @param more  writes further files into the directory it is given, before the rename; may be empty
/// @return the checksum
std::string save_map(const std::string& directory, const MapDirectory& map, bool force = false,
                     const std::function<void(const std::string& directory)>& more = {});

/// The checksum load_map and save_map give.
std::string map_checksum(const OccupancyGrid& occupancy, const DistanceMap& distance);

/// True if `path` is a map directory (has a map.yaml).
bool is_map_directory(const std::string& path);

}  // namespace knav
