#include "planner_tracker/planner_tracker.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/config.h"
#include "planner_tracker/planner_tracker_state.h"

namespace knav {
namespace {

/// Clearances are exact up to this beyond the preferred one.
constexpr double kBeyondPreferred_m = 0.2;
constexpr double kNear_m = 2.5;
constexpr double kClockJump_s = 0.5;

}  // namespace

const char* to_string(Activity activity) {
  switch (activity) {
    case Activity::kIdle:
      return "idle";
    case Activity::kDriving:
      return "driving";
    case Activity::kTurning:
      return "turning towards the path";
    case Activity::kAligning:
      return "aligning at the goal";
    case Activity::kWaiting:
      return "waiting for the way to clear";
    case Activity::kApproaching:
      return "going to see whether the way is still closed";
    case Activity::kBackingUp:
      return "recovery: backing up to see more";
    case Activity::kAvoiding:
      return "recovery: reactive avoidance";
    case Activity::kStopped:
      return "stopped: data missing";
    case Activity::kLostTurning:
      return "recovery: lost, looking round";
    case Activity::kLostWandering:
      return "recovery: lost, wandering";
    case Activity::kReached:
      return "goal reached";
    case Activity::kFailed:
      return "goal failed";
  }
  return "";
}

PlannerTracker::State::State(const PlannerTrackerConfig& c)
    : config(c),
      map(c.preferred_radius_m() + kBeyondPreferred_m, c.clearance.occupied_threshold,
          c.clearance.free_threshold, c.planning.closed_memory_s, 0.0,
          {c.clearance.half_seen_m, c.clearance.half_seen_within_m, c.hard_radius_m(), c.clearance.unseen_depth_m}),
      walkers(c.tracking.walker_stands_s),
      keeper(c),
      tracker(c),
      moves(c, tracker),
      scan(kNear_m, c.preferred_radius_m() + kBeyondPreferred_m) {}

PlannerTracker::PlannerTracker(const PlannerTrackerConfig& config) {
  const auto faults = config.validate();
  if (!faults.empty()) throw_faults(faults);
  state_ = std::make_unique<State>(config);
}
PlannerTracker::~PlannerTracker() = default;

void PlannerTracker::set_map(const DistanceMap& distance, const OccupancyGrid& occupancy,
                             const OccupancyGrid& keepout) {
  state_->map.set_global(distance, occupancy, keepout);
  state_->keeper.set_map(state_->map);
  state_->moving.reset(state_->map.global());
  state_->walkers.clear();
  state_->next_plan_s = -1.0;
}

void PlannerTracker::set_local_map(const OccupancyGrid& local, const Pose2& T_map_local) {
  State& s = *state_;
  s.supposed = s.walkers.may_stand_at();
  s.refused.add_to(&s.supposed, s.last_step_s, s.config.planning.closed_memory_s);
  s.map.set_local(local, T_map_local, s.last_step_s, s.input.T_map_base, s.supposed);
  if (s.map.empty()) return;
  s.moving.update(s.map.global(), s.map.combined(), s.map.local_window(), {s.input.T_map_base.x_m, s.input.T_map_base.y_m}, s.last_step_s);
  s.walkers.update(s.moving.points(), s.map.combined(), s.input.T_map_base, s.last_step_s);
}

void PlannerTracker::clear_local_map() {
  if (state_->map.empty()) return;
  state_->map.clear_local();
  state_->moving.reset(state_->map.global());
  state_->walkers.clear();
  state_->refused.clear();
}

void PlannerTracker::set_scan(const RangeScan& scan, const Pose2& T_base_sensor) {
  state_->scan.set(scan, T_base_sensor);
}

bool PlannerTracker::set_goal(const Pose2& T_map_goal) {
  State& s = *state_;
  s.end_goal();
  s.failure = {};
  if (!is_finite(T_map_goal)) {
    s.failure = {FailureCode::kGoalInvalid, "The goal is not a finite position and heading.", {}};
    return false;
  }
  s.begin(T_map_goal);
  return true;
}

void PlannerTracker::cancel() { state_->end_goal(); }
bool PlannerTracker::has_goal() const { return state_->has_goal; }
const Pose2& PlannerTracker::goal() const { return state_->goal; }
Command PlannerTracker::step(double now_s, const RobotState& robot) { return state_->step(now_s, robot); }
const Failure& PlannerTracker::failure() const { return state_->failure; }
const std::string& PlannerTracker::explanation() const { return state_->explanation; }
const CombinedMap& PlannerTracker::map() const { return state_->map; }
std::size_t PlannerTracker::plans() const { return state_->plans; }

const std::vector<Point2>& PlannerTracker::path() const {
  state_->keeper.path().rest(&state_->shown_path);
  return state_->shown_path;
}

PlanResult PlannerTracker::make_plan(const Point2& start, const Point2& goal, double tolerance_m) {
  State& s = *state_;
  s.asked = {};
  s.asked.at = goal;
  if (s.map.empty()) return s.asked;
  Point2 target = goal;
  GridPlanner& planner = s.keeper.planner();
  if (!planner.open(s.map.combined(), goal) && tolerance_m > 0.0) {
    planner.nearest_open(s.map.combined(), goal, tolerance_m, &target);
  }
  planner.plan(s.map.combined(), start, target, &s.asked);
  if (s.asked.code == PlanCode::kNoPath && !planner.narrow()) {  // as it would be driven
    planner.set_narrow(true);
    planner.plan(s.map.combined(), start, target, &s.asked);
    planner.set_narrow(false);
  }
  return s.asked;
}

void PlannerTracker::State::begin(const Pose2& T_map_goal) {
  goal = T_map_goal;
  has_goal = true;
  goal_started = latched = false;
  keeper.start_goal();
  tracker.reset();
  moves.end();
  next_plan_s = missing_since_s = blocked_since_s = looking_since_s = standing_since_s = near_since_s = lost_since_s = -1.0;
  avoidances = 0;
  refused.clear();
}

void PlannerTracker::State::end_goal() {
  has_goal = false;
  keeper.start_goal();
  moves.end();
  explain("");
}

void PlannerTracker::State::fail(FailureCode code, const Point2& at, std::string reason) {
  end_goal();
  failure = {code, std::move(reason), at};
  explanation = failure.reason;
  command = {};
  command.activity = Activity::kFailed;
  command.finished = true;
}

void PlannerTracker::State::act(Activity activity, const TrackOutput& output) {
  command.activity = activity;
  command.v_mps = std::isfinite(output.v_mps) ? output.v_mps : 0.0;
  command.w_radps = std::isfinite(output.w_radps) ? output.w_radps : 0.0;
}

/// Carried off, or localized at last: the way begins at another place than the one that the goal's time was reckoned from.
void PlannerTracker::State::note_jump(double now_s, const RobotState& robot) {
  constexpr double kElsewhere_m = 1.0;
  constexpr int kMostJumps = 5;  // a localizer that jumps for ever must not keep a goal for ever
  const Pose2 expected = T_map_odom * robot.T_odom_base;
  T_map_odom = robot.T_map_base * robot.T_odom_base.inverse();
  const bool jumped = distance_m(expected, robot.T_map_base) >= kElsewhere_m;
  if (robot.localization != LocalizationState::kUncertain) {
    unproven = false;
  } else if (jumped) {
    unproven = true;
  }
  if (!jumped || ++jumps > kMostJumps) return;
  relocalized = true;
  watch.start(now_s);
}

Command PlannerTracker::State::step(double now_s, const RobotState& robot) {
  const bool jumped = last_step_s >= 0.0 && now_s < last_step_s - kClockJump_s;
  const double dt = last_step_s < 0.0 ? 1.0 / config.controller_frequency : now_s - last_step_s;
  last_step_s = now_s;
  if (jumped) {
    odometry.clear();
    scan.clear();
    scan_fresh = odometry_fresh = pose_fresh = {};
    if (has_goal) {
      fail(FailureCode::kNoSensorData, {robot.T_map_base.x_m, robot.T_map_base.y_m},
           "The clock jumped back; the goal was given up.");
      return command;
    }
  }
  scan_fresh.note(scan.stamp_s(), now_s);
  odometry_fresh.note(robot.odom_stamp_s, now_s);
  pose_fresh.note(robot.pose_stamp_s, now_s);
  if (robot.odom_stamp_s > 0.0) odometry.add(robot.odom_stamp_s, robot.T_odom_base);
  if (!has_goal) {
    command = {};
    return command;
  }
  const double previous_v = command.v_mps, previous_w = command.w_radps;
  command = {};
  if (!goal_started) {
    goal_started = true;
    goal_start_s = now_s;
    goal_allowed_s = 1e9;
    relocalized = false;
    jumps = corrections = 0;
    unproven = false;
    unsure_since_s = -1.0;
    correct_until_s = -1.0;
    T_map_odom = robot.T_map_base * robot.T_odom_base.inverse();
    watch.start(now_s);
  }
  if (stopped_by_missing_data(now_s, robot)) return command;
  note_jump(now_s, robot);

  input.T_map_base = robot.T_map_base;
  input.v_mps = previous_v;
  input.w_radps = previous_w;
  input.dt_s = std::clamp(dt, 0.0, 0.1);
  input.layer = &map.combined();
  input.scan = &scan;
  input.moving = &moving.points();
  walkers.expected(now_s, config.tracking.walker_memory_s, &expected_walkers);
  input.walkers = &expected_walkers;
  Pose2 then = robot.T_odom_base;
  odometry.at(scan.stamp_s(), 1.0, 0.2, &then);
  scan.place(then, robot.T_odom_base);

  if (stopped_by_lost(now_s, robot)) return command;
  if (arrived(robot)) return command;
  if (replan(now_s, robot)) return command;
  if (given_up(now_s, robot)) return command;
  if (avoiding(now_s, robot)) return command;
  drive(now_s, robot);
  return command;
}

}  // namespace knav
