#pragma once

#include <string>

#include "core/pose_buffer.h"
#include "planner_tracker/goal_watch.h"
#include "planner_tracker/moving_cells.h"
#include "planner_tracker/path_tracker.h"
#include "planner_tracker/plan_keeper.h"
#include "planner_tracker/planner_tracker.h"
#include "planner_tracker/random_moves.h"
#include "planner_tracker/refused_ways.h"
#include "planner_tracker/scan_view.h"

namespace knav {

/// When a stream of stamped data last brought something new.
class Freshness {
 public:
  void note(double stamp_s, double now_s) {
    if (stamp_s == stamp_s_ && changed_s_ <= now_s) return;
    stamp_s_ = stamp_s;
    changed_s_ = now_s;
  }
  bool stale(double now_s, double silence_s, double latency_s) const {
    return now_s - changed_s_ > silence_s || now_s - stamp_s_ > latency_s;
  }

 private:
  double stamp_s_ = -1e9, changed_s_ = -1e9;
};

/// The inside of PlannerTracker: one step is a chain of questions, the first that has an answer commands.
struct PlannerTracker::State {
  explicit State(const PlannerTrackerConfig& c);

  Command step(double now_s, const RobotState& robot);
  void begin(const Pose2& T_map_goal);
  void end_goal();
  void wander();
  void note_jump(double now_s, const RobotState& robot);

  // Each returns true if it decided what to do.
  bool stopped_by_missing_data(double now_s, const RobotState& robot);
  bool stopped_by_lost(double now_s, const RobotState& robot);
  bool arrived(const RobotState& robot);
  bool replan(double now_s, const RobotState& robot);
  bool given_up(double now_s, const RobotState& robot);
  bool avoiding(double now_s, const RobotState& robot);
  void drive(double now_s, const RobotState& robot);
  bool looking(double now_s, const RobotState& robot);
  bool backing_up(double now_s, const RobotState& robot, const Point2& from);

  double just_driven_behind_m(const Pose2& T_odom_base) const;
  void act(Activity activity, const TrackOutput& output);
  /// Ends the goal as failed.
  void fail(FailureCode code, const Point2& at, std::string reason);
  void explain(const char* text) {
    if (explanation != text) explanation = text;
  }
  double free_way(const RobotState& robot, double bearing_rad, bool localized) const;

  PlannerTrackerConfig config;
  CombinedMap map;
  MovingCells moving;
  Walkers walkers;
  std::vector<Walker> expected_walkers;
  PlanKeeper keeper;
  PathTracker tracker;
  RandomMoves moves;
  ScanView scan;
  PoseBuffer odometry{1024};
  Freshness scan_fresh, odometry_fresh, pose_fresh;
  GoalWatch watch;

  bool has_goal = false, ending = false;
  Pose2 goal;
  bool latched = false, goal_started = false;
  int corrections = 0;            ///< of the place, after turning at the goal
  double correct_until_s = -1.0;
  double goal_start_s = 0.0, goal_allowed_s = 0.0;
  bool relocalized = false;  ///< the robot turned out to be elsewhere: what it may take begins anew from there
  int jumps = 0;
  Pose2 T_map_odom;          ///< of the last step
  Failure failure;
  std::string explanation;
  PlanKeeper::Outcome outcome = PlanKeeper::Outcome::kToGoal;
  std::vector<Point2> shown_path;

  TrackInput input;
  Command command;
  double last_step_s = -1.0;
  double next_plan_s = -1.0;
  double missing_since_s = -1.0;
  double blocked_since_s = -1.0;
  Point2 blocked_at;
  Pose2 T_odom_blocked;  ///< where the robot was then
  double looking_since_s = -1.0;   ///< standing before a closed way
  double standing_since_s = -1.0;  ///< the same, but looking elsewhere in vain is no new beginning
  double near_since_s = -1.0;     ///< ... or anything else in the way, too near to see well
  int avoidances = 0;
  RefusedWays refused;
  std::vector<Point2> supposed;  ///< what stands where nobody sees it
  double lost_since_s = -1.0, found_since_s = -1.0, turned_rad = 0.0, last_yaw_rad = 0.0;
  bool lost_turn_done = false;
  int lost_rounds = 0;  ///< of looking round and wandering
  bool unproven = false;         ///< the pose has jumped, and the localizer has not been sure of it since
  double unsure_since_s = -1.0;  ///< at the goal, by an estimate that is in doubt
  Pose2 T_odom_lost;
  std::size_t plans = 0;
  PlanResult asked;  ///< for make_plan
};

}  // namespace knav
