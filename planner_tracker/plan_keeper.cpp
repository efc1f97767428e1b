#include "planner_tracker/plan_keeper.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace knav {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
/// Farther from the old path than this, the robot is on another.
constexpr double kOffPath_m = 0.5;

}  // namespace

PlanKeeper::PlanKeeper(const PlannerTrackerConfig& config) : config_(config), planner_(config) {}

void PlanKeeper::set_map(const CombinedMap& map) {
  planner_.set_map(map.global());
  path_.clear();
}

void PlanKeeper::take(const std::vector<Point2>& path) {
  path_.set(path);
  switched_ = true;
  ++switches_;
}

double PlanKeeper::old_cost_m(const MapLayer& layer, const Point2& robot) {
  if (path_.empty()) return kInfinite;
  path_.advance(robot);
  if (path_.offset_m() > kOffPath_m) return kInfinite;
  path_.rest(&rest_);
  double cost = path_.offset_m();
  for (std::size_t i = 1; i < rest_.size(); ++i) {
    cost += planner_.segment_cost_m(layer, rest_[i - 1], rest_[i]);
    // The cells the robot stands in may be closed: it is on its way out of them.
    if (!std::isfinite(cost) && i == 1 && !planner_.open(layer, rest_[0])) cost = path_.remaining_m();
  }
  return cost;
}

bool PlanKeeper::cut_at_blockage(const MapLayer& layer, std::vector<Point2>* way) {
  const double step = 0.5 * layer.geometry.resolution_m;
  std::vector<Point2> kept{way->front()};
  double along = 0.0;
  for (std::size_t i = 1; i < way->size(); ++i) {
    const Point2 a = (*way)[i - 1], b = (*way)[i];
    const double length = std::hypot(b.x_m - a.x_m, b.y_m - a.y_m);
    for (double s = step; s < length; s += step) {
      const Point2 p{a.x_m + (b.x_m - a.x_m) * s / length, a.y_m + (b.y_m - a.y_m) * s / length};
      if (planner_.open(layer, p) || along + s < 2.0 * step) continue;
      at_ = p;
      // A little short of it, so that it is in view.
      const double back = std::max(0.0, s - 0.25);
      kept.push_back({a.x_m + (b.x_m - a.x_m) * back / length, a.y_m + (b.y_m - a.y_m) * back / length});
      way->swap(kept);
      return true;
    }
    kept.push_back(b);
    along += length;
  }
  way->swap(kept);
  return false;
}

PlanKeeper::Outcome PlanKeeper::replan(const CombinedMap& map, const Point2& robot, const Point2& goal) {
  switched_ = false;
  const MapLayer& layer = map.combined();
  Outcome kind = Outcome::kToGoal;
  planner_.plan(layer, robot, goal, &result_);
  if (result_.code == PlanCode::kGoalOccupied || result_.code == PlanCode::kGoalUnknown) {
    at_ = result_.at;
    if (!planner_.open(map.global(), goal)) {
      path_.clear();
      return result_.code == PlanCode::kGoalOccupied ? Outcome::kGoalOccupied : Outcome::kGoalUnknown;
    }
    Point2 nearby;
    if (planner_.nearest_open(layer, goal, config_.planning.goal_snap_m, &nearby)) {
      kind = Outcome::kToNearby;
      planner_.plan(layer, robot, nearby, &result_);
    }
  }
  if (result_.code == PlanCode::kOk) {
    const double old = path_kind_ == kind ? old_cost_m(layer, robot) : kInfinite;
    const bool same_end =
        !path_.empty() && !result_.path.empty() &&
        std::hypot(path_.end().x_m - result_.path.back().x_m, path_.end().y_m - result_.path.back().y_m) <
            (kind == Outcome::kToGoal ? 0.01 : 0.3);
    const bool clearly_better = result_.cost_m < old * (1.0 - config_.planning.switch_gain) &&
                                result_.cost_m < old - config_.planning.switch_gain_m;
    if (!same_end || !std::isfinite(old) || clearly_better) take(result_.path);
    path_kind_ = kind;
    return kind;
  }
  if (result_.code == PlanCode::kStartBlocked) {
    at_ = result_.at;
    path_.clear();
    return Outcome::kStartBlocked;
  }
  // No way now. Has the unchanged map one, and where is it closed?
  planner_.plan(map.global(), robot, goal, &result_);
  if (result_.code != PlanCode::kOk) {
    at_ = result_.at;
    path_.clear();
    return Outcome::kNoPath;
  }
  std::vector<Point2> way = result_.path;
  if (!cut_at_blockage(layer, &way)) at_ = goal;
  const bool keep = path_kind_ == Outcome::kToBlockage && std::isfinite(old_cost_m(layer, robot));
  if (!keep) take(way);
  path_kind_ = Outcome::kToBlockage;
  return Outcome::kToBlockage;
}

}  // namespace knav
