#pragma once

#include <functional>
#include <string>
#include <vector>

#include "brin_benchmark/benchmark.h"
#include "brin_benchmark/goal_suite.h"
#include "brin_benchmark/localization_watch.h"

namespace knav {

inline constexpr double kNearClosedDoor_m = 3.0;  ///< from where a robot that faces a door sees whether it is closed

/// How a goal went.
struct GoalResult {
  SuiteGoal goal;
  bool reached = false;
  int failure_code = 0;            ///< of NavigationFailure; 0 if it ran out of time or arrived elsewhere
  std::string reason;              ///< of those not reached
  double reason_off_m = 0.0;       ///< blocked: from the point it names to the closed door
  double time_s = 0.0, distance_m = 0.0;
  double came_near_s = -1.0;       ///< blocked: of time_s, until it first was within kNearClosedDoor_m of the closed door; -1: never
  double standing_s = 0.0;         ///< of time_s, neither moving nor turning
  double estimate_off_m = 0.0;     ///< reached: where the localizer says it stands, to the goal
  double true_off_m = 0.0;         ///< said to be reached: where it stands, to the goal
  int turned_round = 0, sways = 0;
  int collisions = 0, walker_contacts = 0;
  double moved_after_mps = 0.0;    ///< largest command within a second after the end; |v| + |w|
  Honesty localization;            ///< over time_s, without kNoticeLimit_s after being carried off
  bool carried_off = false;
  KidnapRecovery recovery;         ///< if carried off

  /// A robot that says that it has arrived, but elsewhere, has not: `reached` becomes false, and the reason says so. Built maps are
  /// half a metre off at their far ends; that is not elsewhere.
  void doubt_arrival();
  bool right() const {
    return goal.expected == Expected::kReached ? reached : right_reason(goal.expected, static_cast<FailureCode>(failure_code));
  }
};

struct GoalRunResult {
  std::string name;
  std::vector<GoalResult> goals;
  double time_s = 0.0, distance_m = 0.0;
  double wall_s = 0.0, frame_cost_ms = 0.0;
  double driving_s = 0.0;        ///< of time_s, while the planner followed a plan
  int plans = 0;                 ///< made in that time
  double control_max_ms = 0.0;   ///< the longest control step, with its planning
};

struct GoalRunRecord {
  GoalRunResult result;
  Trajectory truth, estimate;
  std::vector<Point2> failed_at;
};

/// Sends the robot to a run's goals in lock-step. One not reached that could be is looked into (recorder), and the robot is set
/// down there.
GoalRunRecord drive_goals(const SimulatorConfig& simulator, const NavigationStackConfig& stack, const WorldConfig& changed,
                          const MapDirectory& map, const WorldInMap& world_in_map, const SuiteRun& run,
                          const BenchmarkProgress& progress, FlightRecorder* recorder = nullptr);

}  // namespace knav
