#pragma once

#include <vector>

#include "kinect_sim/world.h"
#include "kinect_sim/yaml_map.h"

namespace knav {

/// Dimensions that a world's parts take where they give none.
struct WorldDefaults {
  double wall_height_m = 2.6, wall_thickness_m = 0.10;
};

// Each reads one part of a world, checks it, and appends its prisms.
void read_wall(YamlMap& map, const WorldDefaults& defaults, std::vector<Solid>* solids);
void read_room(YamlMap& map, const WorldDefaults& defaults, std::vector<Solid>* solids);
void read_box(YamlMap& map, bool low, std::vector<Solid>* solids, std::vector<TimedSolid>* timed);
void read_table(YamlMap& map, std::vector<Solid>* solids);
void read_chair(YamlMap& map, std::vector<Solid>* solids);
void read_cylinder(YamlMap& map, std::vector<Solid>* solids);
void read_glass(YamlMap& map, const WorldDefaults& defaults, std::vector<Solid>* solids);
void read_sign(YamlMap& map, std::vector<Solid>* solids);
/// A printed chessboard, and the marker a range finder is aimed at; both hang with their middle at a height.
void read_chessboard(YamlMap& map, std::vector<Panel>* panels);
void read_marker(YamlMap& map, std::vector<Panel>* panels);
void read_stairs(YamlMap& map, std::vector<Solid>* solids, std::vector<FloorRect>* holes);
FloorRect read_floor_rect(YamlMap& map);
DoorConfig read_door(YamlMap& map);
PersonConfig read_person(YamlMap& map);

}  // namespace knav
