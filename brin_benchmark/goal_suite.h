#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "brin_benchmark/layout.h"
#include "brin_benchmark/world_in_map.h"
#include "global_map_builder/map_directory.h"
#include "kinect_sim/world.h"
#include "planner_tracker/planner_tracker.h"

namespace knav {

/// What is right to do about a goal.
enum class Expected {
  kReached,
  kOccupied,  ///< refused: the map has something there (a wall, a keepout)
  kUnknown,   ///< refused: nobody has seen that place
  kBlocked,   ///< given up: the only door is closed
};
const char* to_string(Expected expected);
/// True if a failure with this code is the right answer. A wall's inside may be unknown as well.
bool right_reason(Expected expected, FailureCode code);

struct SuiteGoal {
  std::string kind;  ///< "floor", "table edge", "low box", "stairs", "glass", "closed room", "wall", "outside", "keepout"
  Pose2 T_world_goal;
  Expected expected = Expected::kReached;
  Point2 closed_at;      ///< kBlocked: where
  bool kidnap = false;   ///< the robot is carried off on the way
  Pose2 T_world_kidnap;  ///< ... to there
};

/// A building that has changed since it was mapped, and where the robot is sent in it.
struct SuiteRun {
  std::string name;
  std::string changes;  ///< keys of a world file, as YAML
  std::vector<SuiteGoal> goals;
};

struct GoalSuiteConfig {
  int seed = 1;
  int runs = 5;
  int goals = 67;    ///< over all runs
  int kidnaps = 7;   ///< further ones
  int people = 10;   ///< in every run
  bool unchanged = false;  ///< the building is as it was mapped, and nobody is in it
  double robot_radius_m = 0.20;
  double shortest_way_m = 5.0, longest_way_m = 18.0;
};

/// Draws goals and changes for a building. Goals lie where the map knows the floor: where nobody drove while mapping, a robot
/// is right to refuse. The same world, map and configuration give the same goals. UserError if there is no room.
std::vector<SuiteRun> draw_goals(const WorldConfig& world, const MapDirectory& map, const WorldInMap& world_in_map,
                                 const GoalSuiteConfig& config);

/// Paints glass and stairs, which the sensor does not see, into the keepout mask, as a person would:
/// beside the walls that are round them in the map.
void paint_keepout(const WorldConfig& world, const WorldInMap& world_in_map, MapDirectory* map);

nlohmann::json to_json(const std::vector<SuiteRun>& suite);
std::vector<SuiteRun> suite_from_json(const nlohmann::json& json, const std::string& file);

}  // namespace knav
