#pragma once

#include <map>
#include <string>

#include "core/pose2.h"

namespace knav {

/// Named goals, T_map_robot, of a places.yaml (NAME: {x_m: , y_m: , yaw_rad: }) or of the map directory
/// (or its map.yaml) beside which one lies. UserError names file and place.
std::map<std::string, Pose2> load_places(const std::string& path);

}  // namespace knav
