#pragma once

#include <string>

#include "core/grid_geometry.h"

namespace knav {

/// map_server's YAML file (http://wiki.ros.org/map_server): how an image becomes an occupancy grid.
struct MapImageMeta {
  std::string image;  ///< path, relative paths already resolved against the YAML file's folder
  double resolution_m = 0.05;
  double origin_x_m = 0.0, origin_y_m = 0.0;  ///< lower left corner of the image's lower left pixel
  bool negate = false;
  double occupied_thresh = 0.65;
  double free_thresh = 0.196;
  std::string mode = "trinary";  ///< trinary, scale or raw
};

/// UserError names the file and key. Rotated maps (yaw of origin not 0) are refused.
MapImageMeta read_map_yaml(const std::string& path);
void write_map_yaml(const std::string& path, const MapImageMeta& meta);

/// The image by map_server's rules: its last row is the grid's first.
OccupancyGrid read_map_image(const MapImageMeta& meta);
/// As map_saver: 0 -> 254, 100 -> 0, else 205; exact for grids of 0, 100 and -1.
void write_map_image(const std::string& path, const OccupancyGrid& grid);

}  // namespace knav
