// What closes a way that only the unchanged map has, and from where the robot looks at it.
#include <algorithm>
#include <cmath>

#include "planner_tracker/plan_keeper.h"

namespace knav {
namespace {

constexpr double kNearestLook_m = 0.25;
constexpr int kEnoughLooks = 2;  ///< from different places, where there is no other way to be looked at
constexpr double kAsGood_m = 0.15;       ///< so much farther off is as good a place to look from
constexpr double kStandsBefore_m = 0.6;  ///< what closes a way may reach this far before the point where it does
constexpr double kAside_m = 4.0;    ///< of detour, to look at a way straight and not along the wall, from where a door that has opened looks shut
constexpr double kThrough_m = 0.5;  ///< beyond where it is closed, for a way's direction there
constexpr int kMostPassed = 3;  ///< on a way; each is a search
constexpr int kDirections = 24;
constexpr int kMostTried = 4;

}  // namespace

Point2 PlanKeeper::direction_beyond(const std::vector<Point2>& way, std::size_t segment, const Point2& p) {
  std::vector<Point2> rest{p};
  rest.insert(rest.end(), way.begin() + static_cast<std::ptrdiff_t>(segment), way.end());
  Path beyond;
  beyond.set(rest);
  const Point2 at = beyond.point_at(kThrough_m);
  const double length = std::max(1e-6, std::hypot(at.x_m - p.x_m, at.y_m - p.y_m));
  return {(at.x_m - p.x_m) / length, (at.y_m - p.y_m) / length};
}

bool PlanKeeper::cut_at_blockage(const MapLayer& layer, const MapLayer& unchanged, bool kept, std::vector<Point2>* way) {
  const double step = 0.5 * layer.geometry.resolution_m;
  std::vector<Point2> passed{way->front()};  // every step of the way before the blockage
  for (std::size_t i = 1; i < way->size(); ++i) {
    const Point2 a = (*way)[i - 1], b = (*way)[i];
    const double length = std::hypot(b.x_m - a.x_m, b.y_m - a.y_m);
    for (double s = step; s < length + step; s += step) {
      const double share = std::min(1.0, s / length);
      const Point2 p{a.x_m + (b.x_m - a.x_m) * share, a.y_m + (b.y_m - a.y_m) * share};
      if ((kept ? planner_.kept_open(layer, p) : planner_.open(layer, p)) || passed.size() < 3) {
        passed.push_back(p);
        continue;
      }
      at_ = p;
      through_ = direction_beyond(*way, i, p);
      std::size_t end = passed.size() - 1;
      const auto away_m = [&](std::size_t k) { return std::hypot(passed[k].x_m - p.x_m, passed[k].y_m - p.y_m); };
      while (end > 0 && away_m(end - 1) <= config_.planning.look_distance_m &&
             std::isfinite(planner_.segment_cost_m(unchanged, passed[end - 1], p))) {
        --end;
      }
      // Never right up to it.
      while (end > 0 && away_m(end) < kNearestLook_m) --end;
      passed.resize(end + 1);
      way->swap(passed);
      return true;
    }
  }
  return false;
}

void PlanKeeper::pass_by(const MapLayer& layer, const Point2& robot, std::vector<Point2>* way) {
  const double step = 0.5 * layer.geometry.resolution_m;
  for (int passed = 0; passed < kMostPassed; ++passed) {
    Path line;
    line.set(*way);
    const auto open_at = [&](double along_m) { return planner_.open(layer, line.point_at(along_m)); };
    double closed_m = 2.0 * step;
    while (closed_m < line.length_m() && open_at(closed_m)) closed_m += step;
    double beyond_m = closed_m + kThrough_m;
    while (beyond_m < line.length_m() && !open_at(beyond_m)) beyond_m += step;
    if (beyond_m >= line.length_m()) return;
    planner_.plan(layer, robot, line.point_at(beyond_m), &result_);
    if (result_.code != PlanCode::kOk || result_.cost_m > beyond_m + kAside_m) return;
    std::vector<Point2> by = result_.path;
    double along_m = 0.0;
    for (std::size_t i = 1; i < way->size(); ++i) {
      along_m += std::hypot((*way)[i].x_m - (*way)[i - 1].x_m, (*way)[i].y_m - (*way)[i - 1].y_m);
      if (along_m > beyond_m) by.push_back((*way)[i]);
    }
    way->swap(by);
  }
}

bool PlanKeeper::looks_at_it(const MapLayer& unchanged, const Point2& from) const {
  const double away_m = std::hypot(from.x_m - at_.x_m, from.y_m - at_.y_m);
  return away_m < config_.planning.look_distance_m + kAsGood_m && std::isfinite(planner_.segment_cost_m(unchanged, from, at_));
}

bool PlanKeeper::way_to_look(const MapLayer& layer, const MapLayer& unchanged, const Point2& robot, double beyond_m,
                             std::vector<Point2>* way) {
  std::vector<Point2> places;
  for (const double share : {1.0, 1.12, 1.25}) {
    for (int k = 0; k < kDirections; ++k) {
      const double angle = 2.0 * kPi * k / kDirections, r = share * config_.planning.look_distance_m;
      const double c = std::cos(angle), s = std::sin(angle);
      const Point2 place{at_.x_m + r * c, at_.y_m + r * s}, before{at_.x_m + kStandsBefore_m * c, at_.y_m + kStandsBefore_m * s};
      if (std::isfinite(planner_.segment_cost_m(layer, place, before)) &&
          std::isfinite(planner_.segment_cost_m(unchanged, before, at_))) {
        places.push_back(place);
      }
    }
  }
  const auto away_m = [&](const Point2& p) { return std::hypot(p.x_m - robot.x_m, p.y_m - robot.y_m); };
  places.erase(std::remove_if(places.begin(), places.end(), [&](const Point2& p) { return away_m(p) < beyond_m; }), places.end());
  const auto dear_m = [&](const Point2& p) {
    const double x = at_.x_m - p.x_m, y = at_.y_m - p.y_m;
    return away_m(p) + kAside_m * (1.0 - (x * through_.x_m + y * through_.y_m) / std::hypot(x, y));
  };
  std::sort(places.begin(), places.end(), [&](const Point2& a, const Point2& b) { return dear_m(a) < dear_m(b); });
  for (std::size_t i = 0; i < std::min<std::size_t>(kMostTried, places.size()); ++i) {
    planner_.plan(layer, robot, places[i], &result_);
    if (result_.code != PlanCode::kOk) continue;
    *way = result_.path;
    return true;
  }
  return false;
}

const MapLayer& PlanKeeper::plan_unchanged(CombinedMap& map, const Point2& robot, const Point2& goal) {
  const MapLayer* unchanged = &map.permissive(closed_, kSamePlace_m);
  planner_.plan(*unchanged, robot, goal, &result_);
  if (result_.code != PlanCode::kOk && closed_.size() > 1) {
    // All ways were looked at. What closed the others may have gone since.
    ++rounds_;
    closed_.erase(closed_.begin(), closed_.end() - 1);
    unchanged = &map.permissive(closed_, kSamePlace_m);
    planner_.plan(*unchanged, robot, goal, &result_);
  }
  if (result_.code != PlanCode::kOk && !closed_.empty()) {
    unchanged = &map.permissive();
    planner_.plan(*unchanged, robot, goal, &result_);
  }
  return *unchanged;
}

bool PlanKeeper::another_way(CombinedMap& map, const Point2& robot, const Point2& goal) {
  std::vector<Point2> closed = closed_;
  closed.push_back(at_);
  planner_.plan(map.permissive(closed, kSamePlace_m), robot, goal, &result_);
  return result_.code == PlanCode::kOk;
}

PlanKeeper::Outcome PlanKeeper::go_and_look(CombinedMap& map, const Point2& robot, const Point2& goal, double now_s) {
  const MapLayer& layer = map.combined();
  if (look_elsewhere_ && (++looks_ >= kEnoughLooks || another_way(map, robot, goal))) {
    looks_ = 0;
    closed_.push_back(at_);
    shut_.add(at_, now_s, now_s + config_.planning.closed_memory_s);
    // Another way to be looked at? If not, back to this one, from where it was not looked at last.
    look_elsewhere_ = false;
    path_.clear();
  }
  const MapLayer& unchanged = plan_unchanged(map, robot, goal);
  if (result_.code != PlanCode::kOk) {
    at_ = result_.at;
    path_.clear();
    return Outcome::kNoPath;
  }
  std::vector<Point2> way = result_.path;
  pass_by(layer, robot, &way);
  if (!cut_at_blockage(layer, unchanged, false, &way)) at_ = goal;
  const auto same_place = [&](const Point2& p) { return std::hypot(p.x_m - at_.x_m, p.y_m - at_.y_m) < kSamePlace_m; };
  if (!same_place(last_at_)) looks_ = 0;
  last_at_ = at_;
  const auto too_near = [&](const Point2& p) {
    return std::hypot(p.x_m - at_.x_m, p.y_m - at_.y_m) < config_.planning.too_near_m();
  };
  const bool robot_too_near = too_near(robot);
  // What closes the way may be elsewhere than it seemed from afar: then it is looked at from elsewhere, too.
  const bool still_leads_there = elsewhere_ && std::hypot(path_at_.x_m - at_.x_m, path_at_.y_m - at_.y_m) < 2.0 * kSamePlace_m;
  const bool keep = path_kind_ == Outcome::kToBlockage && !look_elsewhere_ && std::isfinite(old_cost_m(layer, &path_, robot)) &&
                    (still_leads_there || looks_at_it(unchanged, path_.end())) && !(robot_too_near && too_near(path_.end()));
  if (!keep) {
    elsewhere_ = false;
    if (look_elsewhere_) {
      elsewhere_ = way_to_look(layer, unchanged, robot, kElsewhere_m, &way);
    } else if (seen_shut_.has(at_, kSamePlace_m, now_s)) {
      // Looked at already, on the way past or up to it.
      elsewhere_ = way_to_look(layer, unchanged, robot, 0.0, &way);
    } else if (robot_too_near) {
      way_to_look(layer, unchanged, robot, 0.0, &way);
    }
    look_elsewhere_ = false;
    elsewhere_ = elsewhere_ || rounds_ > 1 || std::any_of(closed_.begin(), closed_.end(), same_place);
    path_at_ = at_;
    take(way);
  }
  path_kind_ = Outcome::kToBlockage;
  return Outcome::kToBlockage;
}

}  // namespace knav
