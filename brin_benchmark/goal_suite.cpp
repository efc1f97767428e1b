#include "brin_benchmark/goal_suite.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>

#include "core/error.h"
#include "core/random.h"

namespace knav {
namespace {

constexpr double kFloorClearance_m = 0.45;  ///< of a goal on the open floor
constexpr double kTightClearance_m = 0.32;  ///< of one beside a table or a low box: the robot and 12 cm
constexpr double kBeside_m = 0.9;           ///< so near to a table is beside it
constexpr double kShortestKidnap_m = 4.0;
constexpr int kTries = 60;

double away_m(const Point2& a, const Point2& b) { return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m); }

/// A thing to drive past or up to: goals on both sides of it if the robot gets there.
struct Feature {
  std::string kind;
  std::vector<Point2> beside;
};

class GoalMaker {
 public:
  GoalMaker(const WorldConfig& world, const MapDirectory& map, const WorldInMap& world_in_map, const GoalSuiteConfig& config)
      : world_(world), config_(config), plan_(world, config.robot_radius_m), world_in_map_(world_in_map), known_(0.7, 65, 25) {
    known_.set_global(map.distance, map.occupancy, map.keepout);
    PlannerTrackerConfig robot;
    robot.robot_radius = config.robot_radius_m;
    way_known_ = std::make_unique<GridPlanner>(robot);
    way_known_->set_map(known_.global());
    start_ = world_in_map_ * Point2{world.spawn.x_m, world.spawn.y_m};
    find_features();
  }

  SuiteRun make(int run) {
    run_ = run;
    random_ = RandomStream(static_cast<std::uint64_t>(config_.seed), random_stream::kChanges, static_cast<std::uint64_t>(run), 7);
    SuiteRun out;
    out.name = fmt::format("{} {}", world_.name, run + 1);
    const Sealed sealed = config_.unchanged ? Sealed{} : seal_a_door();
    floor_ = known_only(plan_.reachable(kFloorClearance_m, sealed.leaf));
    if (floor_.size() < 20) throw UserError(world_.file + ": the map knows too little floor to send a robot about.");
    at_ = {world_.spawn.x_m, world_.spawn.y_m};
    const int goals = share(config_.goals), kidnaps = share(config_.kidnaps);
    // Unreachable ones, then what is to be driven up to, then anywhere.
    int to_draw = goals;
    std::vector<SuiteGoal> refused = unreachable(sealed);
    while (static_cast<int>(refused.size()) > std::max(1, goals / 4)) refused.pop_back();
    to_draw -= static_cast<int>(refused.size());
    std::vector<const Feature*> features = some_features(to_draw / 2);
    for (std::size_t next = 0; static_cast<int>(out.goals.size()) < to_draw;) {
      const int left = to_draw - static_cast<int>(out.goals.size());
      const bool special = next < features.size() && random_.uniform() < static_cast<double>(features.size() - next) * 2.0 / left;
      if (special) {
        add_beside(*features[next++], left, &out.goals);
      } else {
        out.goals.push_back(on_the_floor());
      }
    }
    for (SuiteGoal& goal : refused) insert(std::move(goal), &out.goals);
    for (int k = 0; k < kidnaps; ++k) out.goals.push_back(kidnapped());
    if (!config_.unchanged) out.changes = changes(sealed, out.goals);
    return out;
  }

 private:
  struct Sealed {
    std::string door;
    std::vector<Solid> leaf;
    Point2 at;
    std::vector<Point2> behind;
  };

  int share(int all) const { return all * (run_ + 1) / config_.runs - all * run_ / config_.runs; }

  std::size_t pick(std::size_t count) {
    return std::min(count - 1, static_cast<std::size_t>(random_.uniform() * static_cast<double>(count)));
  }

  bool known(const Point2& p) const {
    const Point2 m = world_in_map_ * p;
    if (!way_known_->open(known_.global(), m)) return false;
    PlanResult way;
    way_known_->plan(known_.global(), start_, m, &way);
    return way.code == PlanCode::kOk;
  }

  std::vector<Point2> known_only(const std::vector<Point2>& points) const {
    std::vector<Point2> out;
    for (const Point2& p : points) {
      const Point2 m = world_in_map_ * p;
      if (known_.global().clearance_m(m.x_m, m.y_m) > config_.robot_radius_m + 0.1) out.push_back(p);
    }
    return out;
  }

  void find_features() {
    const std::vector<Point2> tight = known_only(plan_.reachable(kTightClearance_m));
    const auto add = [&](const char* kind, const auto& distance_to) {
      Feature feature{kind, {}};
      for (const Point2& p : tight) {
        if (distance_to(p) < kBeside_m) feature.beside.push_back(p);
      }
      if (feature.beside.size() > 2) features_.push_back(std::move(feature));
    };
    for (const Solid& s : world_.solids) {
      const auto distance_to = [&](const Point2& p) { return footprint_distance_m(s, p); };
      if (s.material == Material::kGlass) {
        add("glass", distance_to);
      } else if (s.bottom_m < 0.02 && s.top_m > 0.02 && s.top_m < 0.13) {
        add("low box", distance_to);
      } else if (s.bottom_m > 0.4 && s.top_m < 1.0 && s.material != Material::kWall) {
        add("table edge", distance_to);
      }
    }
    for (const FloorRect& r : world_.stairs) {
      add("stairs", [&](const Point2& p) {
        return std::hypot(std::max({r.min_x_m - p.x_m, p.x_m - r.max_x_m, 0.0}), std::max({r.min_y_m - p.y_m, p.y_m - r.max_y_m, 0.0}));
      });
    }
  }

  /// Of every kind in turn, so that one table more than stairs does not leave the stairs out.
  std::vector<const Feature*> some_features(int count) {
    std::vector<const Feature*> out;
    static const char* const kKinds[] = {"low box", "table edge", "stairs", "glass"};
    for (int round = 0; static_cast<int>(out.size()) * 2 < count && round < count; ++round) {
      std::vector<const Feature*> of_kind;
      for (const Feature& f : features_) {
        if (f.kind == kKinds[(round + run_) % 4]) of_kind.push_back(&f);
      }
      if (!of_kind.empty()) out.push_back(of_kind[pick(of_kind.size())]);
    }
    return out;
  }

  SuiteGoal goal_at(const char* kind, const Point2& p) {
    SuiteGoal goal;
    goal.kind = kind;
    goal.T_world_goal = {p.x_m, p.y_m, random_.uniform(-kPi, kPi)};
    return goal;
  }

  /// One goal beside the thing, and one on its other side: the straight way leads across it.
  void add_beside(const Feature& feature, int at_most, std::vector<SuiteGoal>* goals) {
    for (int attempt = 0; attempt < kTries; ++attempt) {
      const Point2 p = feature.beside[pick(feature.beside.size())];
      const bool behind_door = std::none_of(floor_.begin(), floor_.end(), [&](const Point2& q) { return away_m(p, q) < 1.5; });
      if (behind_door || !known(p)) continue;
      goals->push_back(goal_at(feature.kind.c_str(), p));
      at_ = p;
      const Point2 q = *std::max_element(feature.beside.begin(), feature.beside.end(),
                                         [&](const Point2& a, const Point2& b) { return away_m(p, a) < away_m(p, b); });
      if (at_most > 1 && away_m(p, q) > 0.8 && known(q)) {
        goals->push_back(goal_at(feature.kind.c_str(), q));
        at_ = q;
      }
      return;
    }
  }

  SuiteGoal on_the_floor() {
    Point2 best = floor_[pick(floor_.size())];
    double best_off = std::numeric_limits<double>::infinity();
    for (int attempt = 0; attempt < kTries && best_off > 0.0; ++attempt) {
      const Point2 p = floor_[pick(floor_.size())];
      if (away_m(at_, p) > config_.longest_way_m || away_m(at_, p) < 0.3 * config_.shortest_way_m || !known(p)) continue;
      const double length = length_m(plan_.path(at_, p));
      if (length <= 0.0) continue;
      const double off = std::max({config_.shortest_way_m - length, length - config_.longest_way_m, 0.0});
      if (off < best_off) {
        best_off = off;
        best = p;
      }
    }
    at_ = best;
    return goal_at("floor", best);
  }

  /// Carried anywhere, and the goal a way from there: else the robot would drive across all of a large building after each.
  SuiteGoal kidnapped() {
    Point2 set_down = floor_[pick(floor_.size())];
    for (int attempt = 0; attempt < kTries && away_m(set_down, at_) < kShortestKidnap_m; ++attempt) set_down = floor_[pick(floor_.size())];
    at_ = set_down;
    SuiteGoal goal = on_the_floor();
    goal.kidnap = true;
    goal.T_world_kidnap = {set_down.x_m, set_down.y_m, random_.uniform(-kPi, kPi)};
    return goal;
  }

  /// A door that is the only way to somewhere, if the building has one.
  Sealed seal_a_door() {
    std::vector<Sealed> found;
    const std::vector<Point2> before = known_only(plan_.reachable(kFloorClearance_m));
    for (const DoorConfig& door : world_.doors) {
      if (door.name.empty()) continue;
      Sealed sealed;
      sealed.door = door.name;
      sealed.leaf = {door_leaf(door, 0.0)};
      sealed.at = {0.5 * (door.hinge.x_m + door.closed_end.x_m), 0.5 * (door.hinge.y_m + door.closed_end.y_m)};
      const std::vector<Point2> after = plan_.reachable(kFloorClearance_m, sealed.leaf);
      std::size_t k = 0;  // both lists are in the grid's order
      for (const Point2& p : before) {
        const auto earlier = [&](const Point2& q) { return q.y_m < p.y_m - 0.01 || (q.y_m < p.y_m + 0.01 && q.x_m < p.x_m - 0.01); };
        while (k < after.size() && earlier(after[k])) ++k;
        const bool still = k < after.size() && away_m(p, after[k]) < 0.01;
        if (!still && away_m(p, sealed.at) > 1.0) sealed.behind.push_back(p);
      }
      if (sealed.behind.size() > 15) found.push_back(std::move(sealed));
    }
    return found.empty() ? Sealed{} : found[pick(found.size())];
  }

  std::vector<SuiteGoal> unreachable(const Sealed& sealed) {
    std::vector<SuiteGoal> goals;
    if (!sealed.door.empty()) {
      SuiteGoal goal = goal_at("closed room", sealed.behind[pick(sealed.behind.size())]);
      goal.expected = Expected::kBlocked;
      goal.closed_at = sealed.at;
      goals.push_back(goal);
    }
    const int which = run_ % 3;
    if (which == 1 && !world_.stairs.empty()) {
      const FloorRect& r = world_.stairs[pick(world_.stairs.size())];
      goals.push_back(goal_at("keepout", {0.5 * (r.min_x_m + r.max_x_m), 0.5 * (r.min_y_m + r.max_y_m)}));
      goals.back().expected = Expected::kOccupied;
    } else if (which == 2) {
      goals.push_back(goal_at("outside", {world_.bounds.max_x_m + 3.0, world_.bounds.max_y_m + 3.0}));
      goals.back().expected = Expected::kUnknown;
    } else {
      std::vector<Point2> inside;
      for (const Solid& s : world_.solids) {
        if (s.material != Material::kWall || s.bottom_m > 0.01 || s.top_m < 1.0) continue;
        Point2 middle;
        for (const Point2& c : s.corners) {
          middle.x_m += c.x_m / static_cast<double>(s.corners.size());
          middle.y_m += c.y_m / static_cast<double>(s.corners.size());
        }
        inside.push_back(middle);
      }
      if (!inside.empty()) {
        goals.push_back(goal_at("wall", inside[pick(inside.size())]));
        goals.back().expected = Expected::kOccupied;
      }
    }
    return goals;
  }

  /// Where it costs the robot the least way.
  void insert(SuiteGoal goal, std::vector<SuiteGoal>* goals) {
    std::size_t best = 0;
    double best_m = std::numeric_limits<double>::infinity();
    const Point2 p{goal.T_world_goal.x_m, goal.T_world_goal.y_m};
    for (std::size_t i = 0; i < goals->size(); ++i) {
      const Pose2& at = (*goals)[i].T_world_goal;
      const double length = length_m(plan_.path({at.x_m, at.y_m}, p));
      if ((*goals)[i].expected != Expected::kReached || length <= 0.0 || length >= best_m) continue;
      best_m = length;
      best = i + 1;
    }
    if (!std::isfinite(best_m)) best = pick(goals->size() + 1);
    goals->insert(goals->begin() + static_cast<std::ptrdiff_t>(best), std::move(goal));
  }

  std::string changes(const Sealed& sealed, const std::vector<SuiteGoal>& goals) const {
    LayoutConfig layout;
    layout.seed = config_.seed;
    layout.robot_radius_m = config_.robot_radius_m;
    layout.people = config_.people;
    layout.closed_door = sealed.door;
    for (const auto& [name, pose] : world_.places) layout.keep_free.push_back({pose.x_m, pose.y_m});
    std::map<std::string, Pose2> places;
    std::vector<std::vector<Point2>> legs;
    Point2 at{world_.spawn.x_m, world_.spawn.y_m};
    for (const SuiteGoal& goal : goals) {
      if (goal.expected != Expected::kReached) continue;
      const Point2 to{goal.T_world_goal.x_m, goal.T_world_goal.y_m};
      places[fmt::format("g{}", places.size() + 1)] = goal.T_world_goal;
      std::vector<Point2> way = plan_.path(at, to);
      if (way.size() > 1) legs.push_back(std::move(way));
      at = to;
    }
    const std::string entry = make_run(plan_, world_, places, legs, layout, run_);
    // An entry of a list, as text: its keys are four spaces deep, the name is on the first line.
    std::string text;
    for (std::size_t from = entry.find('\n') + 1; from < entry.size();) {
      const std::size_t end = std::min(entry.find('\n', from), entry.size());
      text += entry.substr(from + 4, end - from - 4) + "\n";
      from = end + 1;
    }
    return text;
  }

  const WorldConfig& world_;
  const GoalSuiteConfig& config_;
  FloorPlan plan_;
  const WorldInMap& world_in_map_;
  CombinedMap known_;
  std::unique_ptr<GridPlanner> way_known_;
  Point2 start_;
  std::vector<Feature> features_;
  int run_ = 0;
  RandomStream random_{0, random_stream::kChanges, 0, 7};
  std::vector<Point2> floor_;
  Point2 at_;
};

}  // namespace

std::vector<SuiteRun> draw_goals(const WorldConfig& world, const MapDirectory& map, const WorldInMap& world_in_map,
                                 const GoalSuiteConfig& config) {
  GoalMaker maker(world, map, world_in_map, config);
  std::vector<SuiteRun> suite;
  for (int run = 0; run < config.runs; ++run) suite.push_back(maker.make(run));
  return suite;
}

}  // namespace knav
