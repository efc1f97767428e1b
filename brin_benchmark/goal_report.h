#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "brin_benchmark/goal_run.h"

namespace knav {

/// All runs together, beside what is asked for.
struct GoalScore {
  int goals = 0, reachable = 0, reached = 0, unreachable = 0, right = 0, right_in_time = 0, kidnapped = 0, found_again = 0;
  int carried_off = 0, noticed = 0, localized_again = 0;  ///< of those kidnapped for whom there was room
  Honesty localization;
  int collisions = 0, walker_contacts = 0;
  int turned_round = 0, sways = 0;
  double time_s = 0.0, distance_m = 0.0;  ///< of those reached, kidnaps left out
  double speed_mps = 0.0, moving_speed_mps = 0.0;
  double reversals_per_20s = 0.0;
  double estimate_off_max_m = 0.0, estimate_off_mean_m = 0.0, true_off_max_m = 0.0, true_off_mean_m = 0.0;
  double given_up_max_s = 0.0;             ///< from being sent ...
  double given_up_after_near_max_s = 0.0;  ///< ... and from coming within kNearClosedDoor_m of the closed door
  double moved_after_mps = 0.0;
  double plans_per_s = 0.0, control_max_ms = 0.0, frame_cost_ms = 0.0;
};
/// An unreachable goal must be given up within this time.
constexpr double kGiveUpWithin_s = 60.0;

GoalScore score(const std::vector<GoalRunResult>& runs);

nlohmann::json to_json(const GoalScore& score);
nlohmann::json to_json(const GoalRunResult& run);
/// UserError if a field is missing.
GoalRunResult goal_run_from_json(const nlohmann::json& json, const std::string& file);
/// What is asked beside what was measured, goals by kind, every failure.
std::string goal_report_markdown(const std::vector<GoalRunResult>& runs, const std::vector<std::string>& about);

}  // namespace knav
