#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "brin_benchmark/stage_costs.h"

namespace knav {

/// One leg of the sequence.
struct Leg {
  std::string waypoint;
  bool reached = false;
  double time_s = 0.0;
  double distance_m = 0.0;
  double positioning_error_m = 0.0;  ///< of reached ones: true arrival to true position while mapping
  std::string reason;                ///< of failures
};

/// Where and when the robot ran into something.
struct Collision {
  double time_s = 0.0;  ///< since the run began
  double x_m = 0.0, y_m = 0.0;  ///< of the robot, in the world
};

/// A run through the sequence.
struct RunResult {
  std::string name;
  std::vector<Leg> legs;
  std::uint32_t collisions = 0, walker_contacts = 0;
  std::vector<Collision> collisions_at;
  double time_s = 0.0, distance_m = 0.0;
  double wall_s = 0.0;         ///< what it cost
  double frame_cost_ms = 0.0;  ///< of the robot's own work, a frame; 0 = not known
  StageTable stage_cost_ms;    ///< the same by stage; may be empty
  double frames_dropped = 0.0;  ///< share of the depth frames the simulator was too slow for
};

/// A mean and its 95 % confidence interval.
struct Estimate {
  double mean = 0.0, low = 0.0, high = 0.0;
};

/// The metrics of the paper's tables 1 and 2 over runs made one after the other.
struct Score {
  int runs = 0, legs = 0, failures = 0;
  std::uint32_t collisions = 0, walker_contacts = 0;
  double time_s = 0.0, distance_m = 0.0;
  double mean_time_to_failure_s = 0.0, max_time_to_failure_s = 0.0;
  double mean_distance_to_failure_m = 0.0, max_distance_to_failure_m = 0.0;
  double average_speed_mps = 0.0;
  double positioning_error_mean_m = 0.0, positioning_error_sd_m = 0.0, positioning_error_max_m = 0.0;
  Estimate failures_per_run, speed_mps, positioning_error_m;  ///< over runs
};

/// Time and distance to failure are those of the stretches between failures, the last one ending with the
/// runs; without a failure the whole is one stretch. Intervals: bootstrap over runs (2,000 draws, fixed
/// seed).
Score score(const std::vector<RunResult>& runs);

}  // namespace knav
