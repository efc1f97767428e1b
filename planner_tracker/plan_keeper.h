#pragma once

#include <string>
#include <vector>

#include "core/pose2.h"
#include "planner_tracker/combined_map.h"
#include "planner_tracker/grid_planner.h"
#include "planner_tracker/path.h"
#include "planner_tracker/planner_tracker_config.h"
#include "planner_tracker/shut_ways.h"

namespace knav {

/// Replans, and decides what to make of the result: keeps the old plan unless the new one is clearly better,
/// so that maps that shift against each other do not make the robot turn to and fro (the live-lock the paper
/// speaks of), and where the way is closed for now goes there to look.
class PlanKeeper {
 public:
  enum class Outcome {
    kToGoal,      ///< path() leads to the goal
    kToNearby,    ///< something unexpected covers the goal: path() leads to a free point near it
    kToBlockage,  ///< only the unchanged map has a way; path() leads up to where it is closed now: blockage()
    kGoalOccupied,  ///< the robot cannot stand there, now or by the map: at()
    kGoalUnknown,
    kNoPath,        ///< not even the unchanged map has a way
    kStartBlocked,  ///< the robot stands in something
  };

  explicit PlanKeeper(const PlannerTrackerConfig& config);

  void set_map(const CombinedMap& map);
  void start_goal() {
    drop_path();
    planner_.set_narrow(false);
    looks_ = 0;
    rounds_ = 0;
    closed_.clear();
    shut_.clear();
    seen_shut_.clear();
    left_to_somebody_.clear();
  }
  /// The next plan is taken as it is. What was found closed is remembered.
  void drop_path() {
    path_.clear();
    held_.clear();
    held_since_s_ = open_since_s_ = -1.0;
    elsewhere_ = look_elsewhere_ = false;
  }
  /// @param trail  points of the map at which somebody walked a moment ago, see MovingCells
  Outcome replan(CombinedMap& map, const Pose2& robot, const Point2& goal, double now_s, const std::vector<Point2>& trail = {});
  /// True if the way that is closed was open a moment ago and is expected to be again: the outcome is kToBlockage, though there
  /// is a way round.
  bool holding() const { return held_since_s_ >= 0.0; }
  /// Where the robot looks at a closed way from has shown it nothing new: the next replan() leads it to another place, and after
  /// that to another way, if there is one: what closes that one may be gone when it is looked at.
  void look_elsewhere() { look_elsewhere_ = true; }
  /// The way taken is too narrow after all: for closed_memory_s it is open only where a new one would be.
  void too_narrow(double now_s) { strict_until_s_ = now_s + config_.planning.closed_memory_s; }
  /// True while path() leads from one place to look at a closed way from to another, or back to one already looked at.
  bool elsewhere() const { return elsewhere_; }
  /// True if the last replan() replaced the path by another.
  bool switched() const { return switched_; }
  int switches() const { return switches_; }

  /// Along path(); while holding, along the way that is held: seeing it open and closed by turns is neither progress nor the lack of it.
  double remaining_m() const { return holding() ? held_.remaining_m() + held_.offset_m() : path_.remaining_m() + path_.offset_m(); }
  Path& path() { return path_; }
  const Path& path() const { return path_; }
  const Point2& at() const { return at_; }
  GridPlanner& planner() { return planner_; }

 private:
  static constexpr double kSamePlace_m = 1.0;  ///< what closes a way so near by is the same thing
  static constexpr double kElsewhere_m = 0.6;  ///< another place to look from is this far from the last at least

  double old_cost_m(const MapLayer& layer, Path* path, const Point2& robot);
  /// What it costs to turn towards a path's beginning: the metres the robot could have driven meanwhile.
  double turning_cost_m(const Path& path, const Pose2& robot) const;
  /// Forgets who closed a way and has walked on since.
  void let_walk_on(CombinedMap& map, double now_s);
  /// True if the way round is to be left alone for now.
  /// @param round_is_shut  it leads through what was found closed
  bool hold(CombinedMap& map, const Point2& robot, double now_s, const std::vector<Point2>& trail, bool round_is_shut);
  void take(const std::vector<Point2>& path);
  /// True if a way that was looked at and found closed seems open again, barely, and only since a moment ago, to a robot on its way to look at
  /// another one. A lane just as wide as the robot does that.
  bool turns_back_too_soon(const MapLayer& layer, const Point2& robot, double now_s, bool barely_open);
  /// There is no way now. Would there be one, where is it closed, and where can that be looked at from?
  Outcome go_and_look(CombinedMap& map, const Point2& robot, const Point2& goal, double now_s);
  /// A way's direction beyond a point of its segment from way[segment - 1] to way[segment]. There it leads through what is
  /// closed; before, it may come along the wall.
  static Point2 direction_beyond(const std::vector<Point2>& way, std::size_t segment, const Point2& p);
  /// Where the layer closes a way of the unchanged map only for the line that it takes there, leads it past by another.
  void pass_by(const MapLayer& layer, const Point2& robot, std::vector<Point2>* way);
  /// Finds where the layer closes a way of the unchanged map (at_), and keeps the way's beginning up to where the robot
  /// can look at that from look_distance_m, or nearer where corners hide it. False if the layer does not close it.
  /// @param kept  the way was taken, and counts as open where it is a little narrower
  bool cut_at_blockage(const MapLayer& layer, const MapLayer& unchanged, bool kept, std::vector<Point2>* way);
  /// A way to the nearest place from which the blockage can be looked at and that is farther than `beyond_m`, for a robot that
  /// stands too near to it or has seen nothing from where it stands.
  bool way_to_look(const MapLayer& layer, const MapLayer& unchanged, const Point2& robot, double beyond_m, std::vector<Point2>* way);
  /// The unchanged map's best way that avoids what was looked at; if there is none, that avoids what was looked at last; the best of
  /// all if there is none either.
  const MapLayer& plan_unchanged(CombinedMap& map, const Point2& robot, const Point2& goal);
  /// Is there a way past what closes this one, if all else that closes the map went away?
  bool another_way(CombinedMap& map, const Point2& robot, const Point2& goal);
  /// True if the blockage can be looked at from there.
  bool looks_at_it(const MapLayer& unchanged, const Point2& from) const;

  PlannerTrackerConfig config_;
  GridPlanner planner_;
  Path path_;
  Outcome path_kind_ = Outcome::kToGoal;
  PlanResult result_;
  std::vector<Point2> rest_;
  Path held_, tried_;
  double held_since_s_ = -1.0, to_see_s_ = 0.0;
  double strict_until_s_ = -1.0;  ///< see too_narrow()
  double open_since_s_ = -1.0;    ///< see turns_back_too_soon()
  bool strict_ = false;
  bool held_for_somebody_ = false;  ///< who walked there
  struct LeftTo {
    Point2 at;
    double until_s;
  };
  std::vector<LeftTo> left_to_somebody_;
  ShutWays shut_;       ///< waited for in vain
  ShutWays seen_shut_;  ///< at all
  bool look_elsewhere_ = false, elsewhere_ = false;
  int looks_ = 0;                ///< at the present blockage, in vain
  Point2 last_at_;
  Point2 path_at_;  ///< what path() leads to for a look
  std::vector<Point2> closed_;   ///< looked at on the way to this goal, and closed
  int rounds_ = 0;               ///< of looking at every way; from the second on they are no progress
  Point2 at_;
  Point2 through_{1.0, 0.0};  ///< the direction of the way that is closed at at_
  bool switched_ = false;
  int switches_ = 0;
};

}  // namespace knav
