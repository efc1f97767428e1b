#pragma once

#include <string>

namespace knav {

/// A world file of an occupancy image (map_server's grey values: dark = wall, grey = unknown, white = free), extruded: all
/// that is not white is wall, so that the building is closed, but for streaks and specks; the robot starts in the middle of the
/// largest space that does not reach the rim, and only what bounds it is kept; furniture stands about, one piece to 15 m^2. Writes WORLD.yaml and, beside it, the image with its walls. UserError if there is no
/// closed free space.
void write_image_world(const std::string& image_file, double resolution_m, const std::string& world_file, int seed);

}  // namespace knav
