#pragma once

#include <string>
#include <vector>

#include "kinect_sim/world.h"

namespace knav {

/// A building to localize in, as the command line names it.
struct BuildingSource {
  std::string name;
  std::string file;           ///< a world file, or an occupancy image
  double resolution_m = 0.0;  ///< of the image; 0 for a world file
  std::string tour_file;      ///< of the drives through the unchanged building; empty: one is laid out
};

/// NAME=WORLD.yaml or NAME=IMAGE@RESOLUTION. UserError says what is wrong with it.
BuildingSource parse_building(const std::string& text);

/// The files of a building's drives.
struct Building {
  std::string name;
  std::string world_file;    ///< what the map shows
  std::string changed_file;  ///< a share of the furniture moved, doors closed, ten people
  std::string tour_file;     ///< empty: laid out per drive
  std::size_t solids = 0;    ///< prisms it is made of
  std::string changes;       ///< what was changed, in words
};

/// Makes the files, in `folder`: of an image, a world with furniture; of a world, its changed one. Same input and seed, same
/// bytes.
Building prepare_building(const BuildingSource& source, const std::string& folder, int seed);

/// A tour script of at least `length_m`: from the start through places far from each other, in an order drawn from `seed`, a
/// look round at each.
std::string lay_out_drive(const WorldConfig& world, double length_m, int seed);

}  // namespace knav
