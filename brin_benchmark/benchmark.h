#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "brin_benchmark/benchmark_robot.h"
#include "brin_benchmark/flight_recorder.h"
#include "brin_benchmark/navigation_stack.h"
#include "brin_benchmark/scoring.h"
#include "global_map_builder/map_builder.h"
#include "kinect_sim/simulator.h"
#include "kinect_sim/tour.h"

namespace knav {

/// Where a place was when the mapping drive passed it: what the robot is sent to, and what its arrival is
/// measured against (paper section IV.A: the position on the map, and under the fiducial).
struct Waypoint {
  std::string name;
  Pose2 T_map_robot;
  Pose2 T_world_robot;
};

/// A run with its paths.
struct RunRecord {
  RunResult result;
  Trajectory truth, estimate;     ///< T_world_robot, T_map_robot, at 10 Hz
  std::vector<Point2> failed_at;  ///< true positions in the world
};

struct BenchmarkSetup {
  WorldConfig world;  ///< as it is while mapping
  TourScript tour;
  std::vector<std::string> sequence;  ///< names of places
  SimulatorConfig simulator;
  NavigationStackConfig stack;
  MapBuilderConfig map_builder;
  double waypoint_within_m = 1.0;  ///< the tour must pass every place this near
};

using BenchmarkProgress = std::function<void(const std::string& stage, double fraction)>;

/// Drives the tour and builds the map from its frames. `waypoints` receives every place of the sequence;
/// UserError if the tour misses one.
BuiltMap map_world(const BenchmarkSetup& setup, std::vector<Waypoint>* waypoints,
                   const BenchmarkProgress& progress);

/// Sends the robot through the waypoints. A leg not done in its time is a failure; the robot is then set down at that
/// waypoint and goes on.
/// @param T_map_start  where the robot stands as the run begins
/// @param recorder     told of failures and collisions, may be null
RunRecord run_sequence(BenchmarkRobot& robot, const Pose2& T_map_start, const std::vector<Waypoint>& waypoints,
                       const BenchmarkProgress& progress, FlightRecorder* recorder = nullptr);

}  // namespace knav
