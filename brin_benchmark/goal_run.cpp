#include "brin_benchmark/goal_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "brin_benchmark/closed_loop.h"
#include "brin_benchmark/direction_watch.h"
#include "brin_benchmark/set_down.h"
#include "core/error.h"

namespace knav {
namespace {

/// As for a leg of the benchmark: twice the straight way at 0.2 m/s, and a minute. Whoever is carried off has three minutes more.
constexpr double kSlow_mps = 0.2, kGrace_s = 60.0, kKidnapped_s = 180.0;
constexpr double kUnreachable_s = 150.0;  ///< long enough to see when it gives up
constexpr double kAfter_s = 1.0;
constexpr double kWatch_s = 0.1;
constexpr double kCarriedOffAfter_m = 2.0;  ///< or half the way
constexpr double kSetDownRoom_m = 0.15;
constexpr double kElsewhere_m = 1.0;
constexpr double kStands_mps = 0.02, kStands_radps = 0.05;

class GoalDriver {
 public:
  GoalDriver(ClosedLoop& loop, const WorldInMap& world_in_map, FlightRecorder* recorder, const std::function<void()>& poll)
      : loop_(loop), world_in_map_(world_in_map), recorder_(recorder), poll_(poll) {}

  double driving_s() const { return driving_s_; }
  int plans() const { return plans_; }

  GoalResult drive(const SuiteGoal& goal, const std::string& label) {
    result_ = {};
    result_.goal = goal;
    label_ = label;
    const Pose2 T_map_goal = world_in_map_ * goal.T_world_goal;
    start_s_ = loop_.now_s();
    const double start_s = start_s_, start_m = loop_.simulator().distance_driven_m();
    const double straight_m = distance_m(loop_.simulator().T_world_base(), goal.T_world_goal);
    double limit_s = goal.expected == Expected::kReached ? kGrace_s + 2.0 * straight_m / kSlow_mps : kUnreachable_s;
    if (goal.kidnap) limit_s += kKidnapped_s + 2.0 * distance_m(goal.T_world_kidnap, goal.T_world_goal) / kSlow_mps;
    const ContactCount before = loop_.simulator().contacts();
    directions_.start(loop_.simulator().T_world_base());
    watch_.reset();
    bool active = loop_.stack().set_goal(T_map_goal);
    if (!active) note_failure();
    while (active) {
      const Command& command = step();
      if (command.finished) {
        active = false;
        result_.reached = command.activity == Activity::kReached;
        if (!result_.reached) note_failure();
      } else if (loop_.now_s() - start_s > limit_s) {
        active = false;
        result_.reason = fmt::format("not reached within {:.0f} s.", limit_s);
        loop_.stack().cancel();
      }
      const double driven_m = loop_.simulator().distance_driven_m() - start_m;
      if (goal.kidnap && !result_.carried_off && driven_m > std::min(kCarriedOffAfter_m, 0.5 * straight_m)) {
        // Something may stand there: then beside it, as a person would.
        result_.carried_off = set_down_near([&](const Pose2& aside) { return loop_.kidnap(goal.T_world_kidnap * aside, kSetDownRoom_m); });
        if (!result_.carried_off) continue;
        directions_.start(loop_.simulator().T_world_base());
        watch_.emplace(loop_.now_s());
      }
    }
    if (watch_) result_.recovery = watch_->recovery();
    watch_.reset();
    result_.time_s = loop_.now_s() - start_s;
    result_.distance_m = loop_.simulator().distance_driven_m() - start_m;
    result_.turned_round = directions_.turned_round();
    result_.sways = directions_.sways();
    if (result_.reached) {
      Pose2 T_map_robot;
      if (loop_.stack().estimate(&T_map_robot)) result_.estimate_off_m = distance_m(T_map_robot, T_map_goal);
      result_.true_off_m = distance_m(loop_.simulator().T_world_base(), goal.T_world_goal);
      result_.doubt_arrival();
    }
    for (const double until_s = loop_.now_s() + kAfter_s; loop_.now_s() < until_s;) {
      const Command& command = step();
      result_.moved_after_mps = std::max(result_.moved_after_mps, std::abs(command.v_mps) + std::abs(command.w_radps));
    }
    const ContactCount& after = loop_.simulator().contacts();
    result_.collisions = static_cast<int>(after.collisions - before.collisions);
    result_.walker_contacts = static_cast<int>(after.walker_contacts - before.walker_contacts);
    return result_;
  }

 private:
  const Command& step() {
    if (polling_.due(loop_.now_s())) poll_();
    const std::uint32_t collisions = loop_.simulator().contacts().collisions;
    const Command& command = loop_.step();
    if (loop_.simulator().contacts().collisions > collisions && recorder_ != nullptr) {
      const Pose2& at = loop_.simulator().T_world_base();
      recorder_->failure(label_ + "_collision",
                         fmt::format("The robot ran into {} at ({:.2f}, {:.2f}) m of the world.", loop_.simulator().nearest_thing(), at.x_m, at.y_m));
    }
    if (watching_.due(loop_.now_s())) {
      const std::size_t plans = loop_.stack().planner().plans();
      if (command.activity == Activity::kDriving || command.activity == Activity::kTurning) {
        driving_s_ += kWatch_s;
        plans_ += static_cast<int>(plans - last_plans_);
      }
      last_plans_ = plans;
      directions_.add(loop_.simulator().T_world_base());
      if (std::abs(command.v_mps) < kStands_mps && std::abs(command.w_radps) < kStands_radps) result_.standing_s += kWatch_s;
      watch_localization();
      watch_closed_door();
    }
    return command;
  }

  void watch_localization() {
    const Pose2 T_map_robot = world_in_map_ * loop_.simulator().T_world_base();
    Moment m;
    Pose2 T_map_estimate;
    m.stamp_s = loop_.now_s();
    m.dt_s = kWatch_s;
    m.verdict = loop_.stack().verdict();
    m.has_pose = loop_.stack().estimate(&T_map_estimate);
    m.error_m = distance_m(T_map_estimate, T_map_robot);
    m.error_rad = std::abs(normalize_angle_rad(T_map_estimate.yaw_rad - T_map_robot.yaw_rad));
    if (watch_) watch_->add(m);
    if (!watch_ || !watch_->forgiven(m)) result_.localization.add(m);
  }

  void watch_closed_door() {
    if (result_.goal.expected != Expected::kBlocked || result_.came_near_s >= 0.0) return;
    const Pose2& at = loop_.simulator().T_world_base();
    const Point2& closed = result_.goal.closed_at;
    if (std::hypot(at.x_m - closed.x_m, at.y_m - closed.y_m) < kNearClosedDoor_m) result_.came_near_s = loop_.now_s() - start_s_;
  }

  void note_failure() {
    const Failure& failure = loop_.stack().failure();
    result_.failure_code = static_cast<int>(failure.code);
    result_.reason = failure.reason;
    const Point2 closed = world_in_map_ * result_.goal.closed_at;
    if (result_.goal.expected == Expected::kBlocked)
      result_.reason_off_m = std::hypot(failure.at.x_m - closed.x_m, failure.at.y_m - closed.y_m);
  }

  ClosedLoop& loop_;
  const WorldInMap& world_in_map_;
  FlightRecorder* recorder_;
  std::function<void()> poll_;
  GoalResult result_;
  std::string label_;
  double start_s_ = 0.0;  ///< of the goal
  double driving_s_ = 0.0;
  int plans_ = 0;
  std::size_t last_plans_ = 0;
  DirectionWatch directions_;
  std::optional<KidnapWatch> watch_;  ///< while the robot that was carried off has not ended the goal
  Ticker polling_{1.0}, watching_{kWatch_s};
};

}  // namespace

void GoalResult::doubt_arrival() {
  if (!reached || true_off_m <= kElsewhere_m) return;
  reached = false;
  reason = fmt::format("said that it had arrived, {:.1f} m from the goal.", true_off_m);
}

GoalRunRecord drive_goals(const SimulatorConfig& simulator, const NavigationStackConfig& stack, const WorldConfig& changed,
                          const MapDirectory& map, const WorldInMap& world_in_map, const SuiteRun& run,
                          const BenchmarkProgress& progress, FlightRecorder* recorder) {
  const auto wall_start = std::chrono::steady_clock::now();
  GoalRunRecord record;
  record.result.name = run.name;
  ClosedLoop loop(simulator, stack, changed, map, recorder);
  loop.record(&record.truth, &record.estimate);
  loop.start(world_in_map * changed.spawn);
  const double start_s = loop.now_s();
  std::size_t done = 0;
  GoalDriver driver(loop, world_in_map, recorder,
                    [&] { progress("run", static_cast<double>(done) / static_cast<double>(run.goals.size())); });
  for (; done < run.goals.size(); ++done) {
    const SuiteGoal& goal = run.goals[done];
    std::string label = fmt::format("{:02}_{}{}", done + 1, goal.kind, goal.kidnap ? "_kidnapped" : "");
    std::replace(label.begin(), label.end(), ' ', '_');
    record.result.goals.push_back(driver.drive(goal, label));
    const GoalResult& result = record.result.goals.back();
    if (result.right()) continue;
    const Pose2& at = loop.simulator().T_world_base();
    record.failed_at.push_back({at.x_m, at.y_m});
    if (recorder != nullptr) recorder->failure(label, result.reason);
    if (goal.expected == Expected::kReached && !loop.place_near(goal.T_world_goal, world_in_map * goal.T_world_goal)) {
      throw UserError(fmt::format("no room for the robot within 2 m of goal {} of {}.", done + 1, run.name));
    }
  }
  progress("run", 1.0);
  record.result.time_s = loop.now_s() - start_s;
  record.result.distance_m = loop.simulator().distance_driven_m();
  record.result.driving_s = driver.driving_s();
  record.result.plans = driver.plans();
  record.result.control_max_ms = loop.control_max_ms();
  record.result.frame_cost_ms = loop.frame_cost_ms();
  record.result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - wall_start).count();
  return record;
}

}  // namespace knav
