#include "planner_tracker/plan_keeper.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace knav {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
/// Farther from the old path than this, the robot is on another.
constexpr double kOffPath_m = 0.5;
constexpr double kBeginning_m = 0.5;  ///< of a path, for its direction
constexpr double kUnhurried = 1.5;  ///< times as long as at full speed
constexpr double kMovesThere_m = 1.0;   ///< of where the way is closed
constexpr double kNoWayRound_m = 40.0;  ///< so far is a way round that was found closed a moment ago: in a crowd it may be open again soon
constexpr double kWalkedThere_m = 1.5;  ///< who closes it has walked past so near to there
constexpr double kBelieved_s = 2.0;  ///< a way looked at and found closed must be seen open for so long to turn back for
constexpr double kWider_m = 0.05;      ///< a way once found closed must be wider by this on either side to turn back for

}  // namespace

PlanKeeper::PlanKeeper(const PlannerTrackerConfig& config) : config_(config), planner_(config) {}

void PlanKeeper::set_map(const CombinedMap& map) {
  planner_.set_map(map.global());
  start_goal();
}

void PlanKeeper::take(const std::vector<Point2>& path) {
  path_.set(path);
  switched_ = true;
  ++switches_;
}

double PlanKeeper::old_cost_m(const MapLayer& layer, Path* path, const Point2& robot) {
  if (path->empty()) return kInfinite;
  path->advance(robot);
  if (path->offset_m() > kOffPath_m) return kInfinite;
  path->rest(&rest_);
  double cost = path->offset_m();
  for (std::size_t i = 1; i < rest_.size(); ++i) {
    cost += strict_ ? planner_.segment_cost_m(layer, rest_[i - 1], rest_[i]) : planner_.kept_cost_m(layer, rest_[i - 1], rest_[i]);
    // The cells the robot stands in may be closed: it is on its way out of them.
    if (!std::isfinite(cost) && i == 1 && !planner_.open(layer, rest_[0])) cost = path->remaining_m();
  }
  return cost;
}

double PlanKeeper::turning_cost_m(const Path& path, const Pose2& robot) const {
  if (path.remaining_m() < kBeginning_m) return 0.0;
  const Point2 p = robot.inverse() * path.point_at(path.at_m() + kBeginning_m);
  return std::abs(std::atan2(p.y_m, p.x_m)) / config_.max_vel_theta * config_.max_vel_x;
}

void PlanKeeper::let_walk_on(CombinedMap& map, double now_s) {
  const auto gone = [&](const LeftTo& left) {
    if (now_s <= left.until_s) return false;
    map.forget_round(left.at, kMovesThere_m);
    return true;
  };
  left_to_somebody_.erase(std::remove_if(left_to_somebody_.begin(), left_to_somebody_.end(), gone), left_to_somebody_.end());
}

bool PlanKeeper::hold(CombinedMap& map, const Point2& robot, double now_s, const std::vector<Point2>& trail, bool round_is_shut) {
  const bool first = held_since_s_ < 0.0;
  if (first) {
    held_ = path_;
    held_for_somebody_ = false;
  }
  held_.advance(robot);
  if (held_.empty() || held_.offset_m() > kOffPath_m) return false;
  std::vector<Point2> way;
  held_.rest(&way);
  if (way.size() < 2 || !cut_at_blockage(map.combined(), map.global(), !strict_, &way)) return false;
  double until_s = now_s + config_.planning.closed_memory_s;
  if (!seen_shut_.has(at_, kSamePlace_m, now_s)) seen_shut_.add(at_, now_s, until_s);
  const double detour_m = round_is_shut ? kNoWayRound_m : result_.cost_m - held_.remaining_m();
  if (detour_m < config_.planning.hold_detour_m) {
    shut_.add(at_, now_s, until_s);
    return false;
  }
  if (first) {
    held_since_s_ = now_s;
    // From afar a lane looks closed that is not: it is worth going there, unless that is as far as half of the way round.
    Path to_see;
    to_see.set(way);
    const double to_see_m = to_see.length_m();
    to_see_s_ = 2.0 * to_see_m < detour_m ? kUnhurried * to_see_m / config_.max_vel_x : 0.0;
  }
  const auto there = [&](const Point2& p) { return std::hypot(p.x_m - at_.x_m, p.y_m - at_.y_m) < kWalkedThere_m; };
  held_for_somebody_ = held_for_somebody_ || std::any_of(trail.begin(), trail.end(), there);
  const double worth_s = held_for_somebody_ ? config_.planning.hold_share * detour_m / config_.max_vel_x : 0.0;
  if (now_s - held_since_s_ > to_see_s_ + std::max(config_.planning.hold_s, worth_s)) {
    if (held_for_somebody_) {
      until_s = now_s + config_.planning.somebody_memory_s;
      left_to_somebody_.push_back({at_, until_s});
    }
    shut_.add(at_, now_s, until_s);
    return false;
  }
  path_.set(way);
  path_kind_ = Outcome::kToBlockage;
  elsewhere_ = look_elsewhere_ = false;  // it leads to this one now
  return true;
}

bool PlanKeeper::turns_back_too_soon(const MapLayer& layer, const Point2& robot, double now_s, bool barely_open) {
  const bool going_to_look = path_kind_ == Outcome::kToBlockage && !holding() && !closed_.empty() && std::isfinite(old_cost_m(layer, &path_, robot));
  if (!going_to_look || !barely_open) return false;
  if (open_since_s_ < 0.0) open_since_s_ = now_s;
  return now_s - open_since_s_ < kBelieved_s;
}

PlanKeeper::Outcome PlanKeeper::replan(CombinedMap& map, const Pose2& T_map_robot, const Point2& goal, double now_s,
                                       const std::vector<Point2>& trail) {
  switched_ = false;
  strict_ = now_s < strict_until_s_;
  const Point2 robot{T_map_robot.x_m, T_map_robot.y_m};
  let_walk_on(map, now_s);
  const MapLayer& layer = map.combined();
  Outcome kind = Outcome::kToGoal;
  Point2 nearby;
  planner_.plan(layer, robot, goal, &result_);
  if (result_.code == PlanCode::kGoalOccupied || result_.code == PlanCode::kGoalUnknown) {
    at_ = result_.at;
    if (!planner_.open(map.global(), goal)) {
      path_.clear();
      return result_.code == PlanCode::kGoalOccupied ? Outcome::kGoalOccupied : Outcome::kGoalUnknown;
    }
    if (planner_.nearest_open(layer, goal, config_.planning.goal_snap_m, &nearby)) {
      kind = Outcome::kToNearby;
      planner_.plan(layer, robot, nearby, &result_);
    }
  }
  if (kind == Outcome::kToGoal && holding() && std::isfinite(old_cost_m(layer, &held_, robot))) {
    // Open again: on as before.
    path_ = held_;
    path_kind_ = kind;
    held_since_s_ = -1.0;
  }
  const bool no_new_way = result_.code == PlanCode::kNoPath || result_.code == PlanCode::kStartBlocked;
  if (no_new_way && kind == Outcome::kToGoal && path_kind_ == kind && std::isfinite(old_cost_m(layer, &path_, robot))) {
    elsewhere_ = look_elsewhere_ = false;
    return kind;
  }
  if (result_.code == PlanCode::kOk && kind == Outcome::kToNearby) {
    // Right beside it the floor under it is out of sight: whether it has gone is seen from farther off.
    std::vector<Point2> way;
    if (look_elsewhere_ && way_to_look(layer, map.global(), robot, kElsewhere_m, &way)) {
      elsewhere_ = true;
      take(way);
    }
    look_elsewhere_ = false;
    if (elsewhere_ && std::isfinite(old_cost_m(layer, &path_, robot))) {
      path_kind_ = kind;
      return kind;
    }
    planner_.plan(layer, robot, nearby, &result_);
  }
  if (result_.code == PlanCode::kOk) {
    const double old = path_kind_ == kind ? old_cost_m(layer, &path_, robot) : kInfinite;
    const bool was_to_goal = kind == Outcome::kToGoal && (holding() || (path_kind_ == kind && !path_.empty()));
    const auto barely_open = [&] {
      return kind == Outcome::kToGoal && shut_.barely_open(map, result_.path, config_.hard_radius_m() + kWider_m, now_s);
    };
    if (kind == Outcome::kToGoal && turns_back_too_soon(layer, robot, now_s, barely_open())) {
      at_ = last_at_;
      return Outcome::kToBlockage;
    }
    open_since_s_ = -1.0;
    if (was_to_goal && !std::isfinite(old) && hold(map, robot, now_s, trail, barely_open())) return Outcome::kToBlockage;
    held_since_s_ = -1.0;
    elsewhere_ = look_elsewhere_ = false;
    const bool same_end =
        !path_.empty() && !result_.path.empty() &&
        std::hypot(path_.end().x_m - result_.path.back().x_m, path_.end().y_m - result_.path.back().y_m) <
            (kind == Outcome::kToGoal ? 0.01 : 0.3);
    tried_.set(result_.path);
    const double now_cost = old + turning_cost_m(path_, T_map_robot), new_cost = result_.cost_m + turning_cost_m(tried_, T_map_robot);
    const bool clearly_better = new_cost < now_cost * (1.0 - config_.planning.switch_gain) &&
                                new_cost < now_cost - config_.planning.switch_gain_m;
    if (!same_end || !std::isfinite(old) || (clearly_better && !barely_open())) take(result_.path);
    path_kind_ = kind;
    return kind;
  }
  held_since_s_ = open_since_s_ = -1.0;
  if (result_.code == PlanCode::kStartBlocked) {
    at_ = result_.at;
    path_.clear();
    return Outcome::kStartBlocked;
  }
  return go_and_look(map, robot, goal, now_s);
}

}  // namespace knav
