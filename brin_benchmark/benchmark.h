#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "brin_benchmark/navigation_stack.h"
#include "global_map_builder/map_builder.h"
#include "kinect_sim/simulator.h"
#include "kinect_sim/tour.h"

namespace knav {

/// Where a place was when the mapping drive passed it: what the robot is sent to, and what its arrival is measured
/// against (paper section IV.A: the position on the map, and under the fiducial).
struct Waypoint {
  std::string name;
  Pose2 T_map_robot;
  Pose2 T_world_robot;
};

/// One leg of the sequence.
struct Leg {
  std::string waypoint;
  bool reached = false;
  double time_s = 0.0;
  double distance_m = 0.0;
  double positioning_error_m = 0.0;  ///< of reached ones
  std::string reason;                ///< of failures
};

struct BenchmarkResult {
  std::vector<Leg> legs;
  int failures = 0;
  std::uint32_t collisions = 0;
  double time_s = 0.0, distance_m = 0.0;
  double average_speed_mps = 0.0;
  double mean_time_to_failure_s = 0.0, mean_distance_to_failure_m = 0.0;  ///< of the whole run if none failed
  double positioning_error_mean_m = 0.0, positioning_error_sd_m = 0.0;
  Trajectory truth, estimate;  ///< T_world_robot, T_map_robot, at 10 Hz
};

struct BenchmarkSetup {
  WorldConfig mapping_world, world;  ///< the second may have people and changes
  TourScript tour;
  std::vector<std::string> sequence;  ///< names of places
  SimulatorConfig simulator;
  NavigationStackConfig stack;
  MapBuilderConfig map_builder;
  double waypoint_within_m = 1.0;  ///< the tour must pass every place this near
};

using BenchmarkProgress = std::function<void(const std::string& stage, double fraction)>;

/// Drives the tour and builds the map from its frames. `waypoints` receives every place of the sequence; UserError if
/// the tour misses one.
BuiltMap map_world(const BenchmarkSetup& setup, std::vector<Waypoint>* waypoints, const BenchmarkProgress& progress);

/// Sends the robot through the sequence in lock-step. A leg not done in its time is a failure; the robot is then set
/// down at that waypoint and goes on.
BenchmarkResult run_sequence(const BenchmarkSetup& setup, const MapDirectory& map,
                             const std::vector<Waypoint>& waypoints, const BenchmarkProgress& progress);

}  // namespace knav
