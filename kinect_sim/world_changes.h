#pragma once

#include <functional>

#include "kinect_sim/world.h"
#include "kinect_sim/yaml_map.h"

namespace knav {

/// Reads the keys that change what a `base` world has: `removed`, `moved` and `door_states`.
void read_changes(YamlMap& map, WorldConfig* world);

/// Reads a door's `open_deg` and `schedule`, where given.
void read_door_state(YamlMap& map, DoorConfig* door);

/// Runs `read` and notes the solids it added as one piece that stands at `at`.
void add_piece(const Point2& at, WorldConfig* world, const std::function<void()>& read);

}  // namespace knav
