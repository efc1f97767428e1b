// A robot that is not localized: it stops, looks round, wanders a little, until it is.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "planner_tracker/planner_tracker_state.h"

namespace knav {
namespace {

constexpr double kFoundFor_s = 0.5;  ///< localized for this long ends the recovery

}  // namespace

double PlannerTracker::State::free_way(const RobotState&, double bearing_rad, bool localized) const {
  constexpr double kFar_m = 1.5;
  const double radius = tracker.safe_radius_m();
  if (localized) {
    // By scan and map together, as far as the footprint goes; known only.
    return tracker.straight_free_m(input, bearing_rad, kFar_m);
  }
  // The map is of no use: only where the scan knows what is there.
  return std::min(kFar_m, scan.free_m(bearing_rad, radius + config.clearance.hard_m, true));
}

bool PlannerTracker::State::stopped_by_lost(double now_s, const RobotState& robot) {
  const bool lost = robot.localization == LocalizationState::kLost;
  if (lost_since_s < 0.0) {
    if (!lost) return false;
    lost_since_s = now_s;
    lost_turn_done = false;
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
      lost_turn_done = true;
      moves.start(3);
    } else if (std::abs(turn.v_mps) < 0.01) {
      turn.w_radps = std::clamp(config.recovery.lost_turn_radps, input.w_radps - step, input.w_radps + step);
    }
    act(Activity::kLostTurning, turn);
    return true;
  }
  if (!lost_turn_done) {
    lost_turn_done = true;
    moves.start(3);
  }
  if (!moves.active()) {
    // Looks round again from the new place.
    lost_turn_done = false;
    turned_rad = 0.0;
    act(Activity::kLostWandering, tracker.stop(input));
    return true;
  }
  const TrackOutput move = moves.step(input, robot.T_odom_base, [&](double bearing) {
    const double way = free_way(robot, bearing, false);
    const Pose2 end = robot.T_odom_base * Pose2{way * std::cos(bearing), way * std::sin(bearing), 0.0};
    const double beyond = distance_m(end, T_odom_lost) - config.recovery.wander_radius_m;
    return beyond > 0.0 ? way - beyond : way;
  });
  act(Activity::kLostWandering, move);
  return true;
}

}  // namespace knav
