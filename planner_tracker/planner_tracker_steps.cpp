// The questions PlannerTracker::State::step() asks, in its order.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "planner_tracker/planner_tracker_state.h"

namespace knav {
namespace {

constexpr double kFailedPlanWait_s = 1.0;  ///< a search that finds nothing is the dearest
constexpr double kGotOn_m = 0.05, kGotOn_rad = 0.2;
constexpr double kCorrectFor_s = 5.0;  ///< a goal driven up to anew must be come nearer to, or the robot would not stir
constexpr double kAllowance_s = 60.0;
constexpr double kOpenEnough_m = 1.5;  ///< for a step aside
constexpr double kFloorSeenFrom_m = 1.2;  ///< nearer, a level Kinect at 0.5 m does not see the floor

constexpr double kSureWithin_s = 8.0;  ///< who was carried off is told so by then; in a building that has changed doubt may stay

bool unsure(const RobotState& robot) { return robot.localization == LocalizationState::kUncertain; }

Point2 position(const Pose2& pose) { return {pose.x_m, pose.y_m}; }

}  // namespace

bool PlannerTracker::State::stopped_by_missing_data(double now_s, const RobotState& robot) {
  const FreshnessConfig& f = config.freshness;
  const auto stale = [&](const Freshness& data, double limit_s) {
    return data.stale(now_s, limit_s, f.latency_s);
  };
  const char* why = nullptr;
  if (map.empty())
    why = "There is no map yet.";
  else if (scan.empty())
    why = "No scan_360 came yet; is the local mapper running?";
  else if (stale(scan_fresh, f.scan_s))
    why = "The last scan_360 is too old; the camera or the local mapper stopped.";
  else if (stale(odometry_fresh, f.pose_s))
    why = "The last odometry is too old; the base stopped sending it.";
  else if (!robot.has_pose)
    why = "There is no transform from the map to the robot; is the localizer running?";
  else if (stale(pose_fresh, f.pose_s))
    why = "The transform from the map to the robot is too old; the localizer stopped.";
  else if (!is_finite(robot.T_map_base) || !is_finite(robot.T_odom_base))
    why = "The robot's pose is not finite.";
  else if (robot.localization != LocalizationState::kUnknown &&
           now_s - robot.localization_stamp_s > f.localization_s) {
    why = "The localizer fell silent.";
  } else if (robot.localization == LocalizationState::kInitializing)
    why = "The localizer has not started yet; give it an initial pose.";
  if (why == nullptr) {
    if (missing_since_s >= 0.0) {
      missing_since_s = -1.0;
      explain("");
    }
    return false;
  }
  if (missing_since_s < 0.0) missing_since_s = now_s;
  explain(why);
  // Without eyes the brakes are the base's own: zero at once.
  act(Activity::kStopped, {});
  if (now_s - missing_since_s > f.give_up_s) {
    fail(FailureCode::kNoSensorData, position(robot.T_map_base),
         fmt::format("{} Given up after {:.0f} s.", why, f.give_up_s));
  }
  return true;
}

bool PlannerTracker::State::arrived(const RobotState& robot) {
  const Pose2 T_base_goal = robot.T_map_base.inverse() * goal;
  const double distance = std::hypot(T_base_goal.x_m, T_base_goal.y_m);
  if (!latched) {
    // Not at the tolerance's rim, if driving on still brings it nearer.
    const bool nearest =
        distance < 0.4 * config.xy_goal_tolerance || T_base_goal.x_m < 0.3 * distance || (input.v_mps < 0.03 && last_step_s > correct_until_s);
    latched = distance < config.xy_goal_tolerance && nearest;
  } else if (!config.latch_xy_goal_tolerance && distance > config.xy_goal_tolerance) {
    latched = false;
  } else if (distance > 3.0 * config.xy_goal_tolerance + 0.2) {
    latched = false;  // pushed, or relocalized
  }
  if (!latched) return false;
  const double error = T_base_goal.yaw_rad;
  const bool still = std::abs(input.v_mps) < 0.01 && std::abs(robot.v_mps) < 0.05 &&
                     std::abs(input.w_radps) <= config.acc_lim_theta * input.dt_s + 1e-9;
  if (std::abs(error) < config.yaw_goal_tolerance && still) {
    if (unsure(robot)) {
      if (unsure_since_s < 0.0) unsure_since_s = last_step_s;
      if (last_step_s - unsure_since_s < kSureWithin_s) {
        act(Activity::kAligning, tracker.stop(input));
        return true;
      }
    }
    unsure_since_s = -1.0;
    if (distance > config.xy_goal_tolerance && corrections < config.goal_corrections) {
      // While it turned it saw more, and the localizer has it elsewhere now.
      ++corrections;
      latched = false;
      correct_until_s = last_step_s + kCorrectFor_s;
      next_plan_s = -1.0;
      return false;
    }
    end_goal();
    command = {};
    command.activity = Activity::kReached;
    command.finished = true;
    return true;
  }
  const TrackOutput turn = std::abs(error) < 0.5 * config.yaw_goal_tolerance ? tracker.stop(input) : tracker.turn(input, error);
  if (turn.kind != TrackOutput::Kind::kBlocked) {
    blocked_since_s = -1.0;
  } else if (blocked_since_s < 0.0) {
    blocked_since_s = last_step_s;
  } else if (last_step_s - blocked_since_s > config.planning.blocked_timeout_s) {
    fail(FailureCode::kBlocked, position(robot.T_map_base), "The robot stands at the goal but has no room to turn to its heading.");
    return true;
  }
  act(Activity::kAligning, turn);
  return true;
}

bool PlannerTracker::State::replan(double now_s, const RobotState& robot) {
  if (now_s < next_plan_s) return false;
  next_plan_s = now_s + 1.0 / config.planner_frequency - 0.5 / config.controller_frequency;
  const bool first = goal_allowed_s > 1e8, allowance_due = first || relocalized;
  ++plans;
  outcome = keeper.replan(map, robot.T_map_base, position(goal), now_s, moving.trail());
  using Outcome = PlanKeeper::Outcome;
  if (outcome == Outcome::kNoPath && first) {
    // A lane just as wide as the robot, in a map whose walls are a little too thick: better tried than given up.
    keeper.planner().set_narrow(true);
    outcome = keeper.replan(map, robot.T_map_base, position(goal), now_s, moving.trail());
  }
  // No way but the one that was refused: to be tried again.
  if (outcome != Outcome::kToGoal && !keeper.holding()) refused.clear();
  // There was a way to this goal before: it is where the robot stands that has none.
  if (outcome == Outcome::kNoPath && !first) outcome = Outcome::kStartBlocked;
  const Point2& at = keeper.at();
  switch (outcome) {
    case Outcome::kToGoal:
      explain("");
      break;
    case Outcome::kToNearby:
      explain("Something stands on the goal; going near it.");
      break;
    case Outcome::kToBlockage:
      if (!keeper.holding()) next_plan_s = now_s + kFailedPlanWait_s;
      explanation = fmt::format(keeper.holding() ? "Something has come into the way at ({:.2f}, {:.2f}) m; it may move on."
                                                 : "The way is closed at ({:.2f}, {:.2f}) m.",
                                at.x_m, at.y_m);
      break;
    case Outcome::kGoalOccupied:
      fail(
          FailureCode::kGoalOccupied, at,
          fmt::format("The robot cannot stand at the goal: ({:.2f}, {:.2f}) m is occupied.", at.x_m, at.y_m));
      return true;
    case Outcome::kGoalUnknown:
      fail(FailureCode::kGoalUnknown, at,
           fmt::format("The goal lies in or beside unknown space, at ({:.2f}, {:.2f}) m.", at.x_m, at.y_m));
      return true;
    case Outcome::kNoPath:
      fail(FailureCode::kNoPath, at,
           fmt::format("No way leads to the goal; the nearest place looked at is ({:.2f}, {:.2f}) m.", at.x_m,
                       at.y_m));
      return true;
    case Outcome::kStartBlocked:
      next_plan_s = now_s + kFailedPlanWait_s;
      explain("The robot stands in or against something.");
      break;
  }
  if (allowance_due && outcome == Outcome::kToGoal) {
    relocalized = false;
    goal_allowed_s = now_s - goal_start_s + kAllowance_s + config.planning.slowness * keeper.path().length_m() / config.max_vel_x;
  }
  return false;
}

bool PlannerTracker::State::given_up(double now_s, const RobotState& robot) {
  keeper.path().advance(position(robot.T_map_base));
  watch.progress(now_s, keeper.remaining_m(), keeper.switched() && !keeper.elsewhere());
  const bool stuck = watch.without_progress_s(now_s) > config.planning.blocked_timeout_s;
  const bool slow = !relocalized && now_s - goal_start_s > goal_allowed_s;
  if (!stuck && !slow) return false;
  using Outcome = PlanKeeper::Outcome;
  if (outcome == Outcome::kStartBlocked) {
    fail(FailureCode::kStartOccupied, position(robot.T_map_base),
         "The robot stands in something and found no way out.");
    return true;
  }
  Point2 at = outcome == Outcome::kToGoal ? (blocked_since_s >= 0.0 ? blocked_at : position(robot.T_map_base))
                                          : keeper.at();
  const char* what = outcome == Outcome::kToNearby ? "Something stands on the goal" : "The way is closed";
  if (stuck) {
    fail(FailureCode::kBlocked, at,
         fmt::format("{} at ({:.2f}, {:.2f}) m and no other way was found for {:.0f} s.", what, at.x_m,
                     at.y_m, config.planning.blocked_timeout_s));
  } else {
    fail(FailureCode::kBlocked, at,
         fmt::format("Given up after {:.0f} s: the way to the goal took far longer than planned.",
                     goal_allowed_s));
  }
  return true;
}

bool PlannerTracker::State::avoiding(double now_s, const RobotState& robot) {
  // Who stands to look at what closes the way is not trying to get on.
  const bool driving = !moves.active() && looking_since_s < 0.0 && keeper.path().remaining_m() > 0.3;
  const double dithering = watch.dithering_s(now_s, robot.T_odom_base, driving, config.oscillation_distance);
  if (!moves.active()) {
    const bool waited =
        blocked_since_s >= 0.0 && now_s - blocked_since_s > config.planning.controller_patience;
    const bool oscillating = config.oscillation_timeout > 0.0 && dithering > config.oscillation_timeout;
    const bool stuck = outcome == PlanKeeper::Outcome::kStartBlocked &&
                       watch.without_progress_s(now_s) > config.planning.controller_patience;
    // What closes the way may have gone: it stands too near for its floor to be seen, so nothing can clear it
    // here.
    const bool blind = standing_since_s >= 0.0 &&
                       now_s - standing_since_s > 2.0 * config.planning.controller_patience &&
                       std::hypot(keeper.at().x_m - robot.T_map_base.x_m,
                                  keeper.at().y_m - robot.T_map_base.y_m) < kFloorSeenFrom_m;
    if (!waited && !oscillating && !stuck && !blind) return false;
    if (waited && outcome == PlanKeeper::Outcome::kToGoal) refused.note(blocked_at, now_s);
    blocked_since_s = looking_since_s = standing_since_s = near_since_s = -1.0;
    watch.dithering_s(now_s, robot.T_odom_base, false, 0.0);
    ++avoidances;
    moves.start(blind ? 4 : 2, {config.recovery.avoid_min_m, config.recovery.avoid_max_m, kOpenEnough_m, config.tracking.slow_mps + 0.05});
    explanation = waited        ? "Something stays in the way; trying random moves towards open space."
                  : blind       ? "The way is closed right here; stepping back to look again."
                  : oscillating ? "Driving without getting on; trying random moves towards open space."
                                : "No way out of this place; trying random moves towards open space.";
    tracker.reset();
  }
  const TrackOutput move =
      moves.step(input, robot.T_odom_base, [&](double bearing) { return free_way(robot, bearing, true); });
  act(Activity::kAvoiding, move);
  if (!moves.active()) {
    next_plan_s = -1.0;
    keeper.drop_path();
  }
  return true;
}

void PlannerTracker::State::drive(double now_s, const RobotState& robot) {
  using Outcome = PlanKeeper::Outcome;
  const Path& path = keeper.path();
  if (path.empty()) {
    act(Activity::kWaiting, tracker.stop(input));
    return;
  }
  const bool to_goal = outcome == Outcome::kToGoal;
  const double remaining = path.remaining_m() + path.offset_m();
  if (!to_goal && looking(now_s, robot)) return;
  looking_since_s = standing_since_s = -1.0;
  if (to_goal && config.min_vel_x < 0.0 && remaining < 0.3) {
    // A goal just overshot, straight behind: back up over what was just driven, if it is still seen free.
    const Point2 p = robot.T_map_base.inverse() * position(goal);
    if (p.x_m < -0.02 && std::abs(p.y_m) < 0.3 * std::abs(p.x_m) &&
        scan.free_m(kPi, tracker.safe_radius_m(), true) > -p.x_m + 0.05) {
      const TrackOutput back = tracker.creep(input, p.x_m);
      if (back.kind != TrackOutput::Kind::kBlocked) {
        act(Activity::kDriving, back);
        return;
      }
    }
  }
  // On short ways to and fro before something, all that is near is unseen: turning to look at each step would get it nowhere.
  input.map = to_goal ? &map : nullptr;
  const TrackOutput out = tracker.follow(input, path);
  if (out.kind == TrackOutput::Kind::kBlocked) {
    if (blocked_since_s < 0.0) {
      blocked_since_s = now_s;
      T_odom_blocked = robot.T_odom_base;
    }
    blocked_at = out.obstacle;
    if (now_s - blocked_since_s > 0.5 * config.planning.controller_patience) keeper.too_narrow(now_s);
    if (backing_up(now_s, robot, blocked_at)) return;
    act(Activity::kWaiting, out);
    return;
  }
  // Who turns a little, and is blocked again, has not got on.
  const Pose2 moved = T_odom_blocked.inverse() * robot.T_odom_base;
  if (std::hypot(moved.x_m, moved.y_m) > kGotOn_m || std::abs(moved.yaw_rad) > kGotOn_rad) blocked_since_s = -1.0;
  near_since_s = -1.0;
  act(out.kind == TrackOutput::Kind::kTurning ? Activity::kTurning
      : to_goal                               ? Activity::kDriving
                                              : Activity::kApproaching,
      out);
}

}  // namespace knav
