// A robot that is not localized: it stops, looks round, wanders a little, until it is.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "planner_tracker/planner_tracker_state.h"

namespace knav {
namespace {

constexpr double kFoundFor_s = 0.5;  ///< localized for this long ends the recovery
constexpr int kMoves = 2;            ///< between two looks round
constexpr double kShortest_m = 0.4;  ///< of these; shorter ones show nothing new
constexpr double kSees_m = 4.0;      ///< a direction more open than this is not better

/// How far straight on a robot stays within `radius_m` of where it was; from outside, 0 unless that leads back inside.
double within_reach_m(const Pose2& T_odom_from, double radius_m, const Pose2& T_odom_base, double bearing_rad) {
  const double x = T_odom_base.x_m - T_odom_from.x_m, y = T_odom_base.y_m - T_odom_from.y_m, heading = T_odom_base.yaw_rad + bearing_rad;
  const double along = x * std::cos(heading) + y * std::sin(heading), across2 = x * x + y * y - along * along;
  return across2 < radius_m * radius_m ? std::max(0.0, std::sqrt(radius_m * radius_m - across2) - along) : 0.0;
}

}  // namespace

double PlannerTracker::State::free_way(const RobotState&, double bearing_rad, bool localized) const {
  const double radius = tracker.safe_radius_m();
  if (localized) {
    constexpr double kFar_m = 1.5;
    // By scan and map together, as far as the footprint goes; known only.
    return tracker.straight_free_m(input, bearing_rad, kFar_m);
  }
  // The map is of no use: only where the scan knows what is there.
  return std::min(kSees_m, scan.free_m(bearing_rad, radius + config.clearance.hard_m, true));
}

/// Where it is cannot be told from here, as in a corridor: the longer it is lost, the farther it goes.
void PlannerTracker::State::wander() {
  lost_turn_done = true;
  ++lost_rounds;
  const double longest_m = std::max(config.recovery.wander_step_m, kShortest_m);
  moves.start(kMoves, {kShortest_m, longest_m, kSees_m, config.recovery.wander_mps});
}

bool PlannerTracker::State::stopped_by_lost(double now_s, const RobotState& robot) {
  // A place that the localizer has just jumped to and is not sure of is none to drive on from.
  const bool lost = robot.localization == LocalizationState::kLost || unproven;
  if (lost_since_s < 0.0) {
    if (!lost) return false;
    lost_since_s = now_s;
    lost_turn_done = false;
    lost_rounds = 0;
    turned_rad = 0.0;
    last_yaw_rad = robot.T_odom_base.yaw_rad;
    T_odom_lost = robot.T_odom_base;
    moves.end();
    keeper.start_goal();
    explain("The localizer does not know where the robot is.");
  }
  if (!lost) {
    // Not on the first good word: stands until it is sure.
    if (found_since_s < 0.0) found_since_s = now_s;
    act(Activity::kLostTurning, tracker.stop(input));
    if (now_s - found_since_s < kFoundFor_s) return true;
    relocalized = true;
    lost_since_s = found_since_s = -1.0;
    moves.end();
    explain("");
    next_plan_s = -1.0;
    watch.start(now_s);
    return false;
  }
  found_since_s = -1.0;
  if (now_s - lost_since_s > config.recovery.lost_timeout_s) {
    fail(FailureCode::kLost, {robot.T_map_base.x_m, robot.T_map_base.y_m},
         fmt::format("Not localized for {:.0f} s, after looking round and wandering.",
                     config.recovery.lost_timeout_s));
    return true;
  }
  turned_rad += normalize_angle_rad(robot.T_odom_base.yaw_rad - last_yaw_rad);
  last_yaw_rad = robot.T_odom_base.yaw_rad;
  if (!lost_turn_done && std::abs(turned_rad) < 2.0 * kPi) {
    TrackOutput turn = tracker.stop(input);
    const double step = config.acc_lim_theta * input.dt_s;
    TrackInput scan_only = input;
    scan_only.layer = nullptr;
    constexpr double kAhead_rad = 0.3;
    if (tracker.turn_free_rad(scan_only, 1.0, kAhead_rad) < kAhead_rad) {
      // A corner of the footprint is in the way: a look from elsewhere then.
      wander();
    } else if (std::abs(turn.v_mps) < 0.01) {
      turn.w_radps = std::clamp(config.recovery.lost_turn_radps, input.w_radps - step, input.w_radps + step);
    }
    act(Activity::kLostTurning, turn);
    return true;
  }
  if (!lost_turn_done) wander();
  if (!moves.active()) {
    // Looks round again from the new place.
    lost_turn_done = false;
    turned_rad = 0.0;
    act(Activity::kLostWandering, tracker.stop(input));
    return true;
  }
  const TrackOutput move = moves.step(input, robot.T_odom_base, [&](double bearing) {
    return std::min(free_way(robot, bearing, false), within_reach_m(T_odom_lost, config.recovery.wander_radius_m * lost_rounds, robot.T_odom_base, bearing));
  });
  act(Activity::kLostWandering, move);
  return true;
}

}  // namespace knav
