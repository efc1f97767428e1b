#include <gtest/gtest.h>

#include <cmath>

#include "planner_tracker/path_tracker.h"
#include "planner_tracker/planner_tracker.h"
#include "toy_world.h"

namespace knav {
namespace {

TEST(Tracker, ACornerRightBesideTheRobotIsTurnedAwayFromAndPassed) {
  // In a gap of 0.6 m, its left corner nearer than any arc from this heading could pass, with a hand's breadth to spare on the right: it
  // waited there, and then tried random moves.
  OccupancyGrid grid = room(5.0, 2.0);
  fill(&grid, 2.0, 0.0, 2.5, 2.0, 100);
  fill(&grid, 2.0, 0.7, 2.5, 1.3, 0);
  for (const Pose2& start : {Pose2{1.80, 1.09, 0.30}, Pose2{1.88, 1.10, 0.45}, Pose2{1.92, 1.09, 0.15}, Pose2{2.08, 1.09, 0.30}}) {
    ToyWorld world(grid, grid, start);
    ASSERT_TRUE(world.planner.set_goal({4.0, 1.0, 0.0}));
    const double began_s = world.now_s;
    const Command command = world.run(60.0);
    ASSERT_EQ(command.activity, Activity::kReached) << world.planner.failure().reason;
    EXPECT_EQ(world.collisions, 0) << start.x_m;
    EXPECT_EQ(world.avoidances, 0) << start.x_m;
    EXPECT_LT(world.now_s - began_s, 12.0) << start.x_m;
  }
}

TEST(Tracker, WhereTheArcSweepsUnseenGroundTheRobotTurnsToLookFirst) {
  // A path that bends to the left by less than what makes the robot turn in place anyway. A quarter of a metre left of it nobody has looked.
  const PlannerTrackerConfig config;
  const OccupancyGrid free = room(4.0, 4.0);
  CombinedMap map(0.6, config.clearance.occupied_threshold, config.clearance.free_threshold);
  map.set_global({}, free, {});
  const ScanView view = open_view();
  Path path;
  path.set({{1.0, 2.0}, {2.0, 2.35}});
  for (const bool seen : {true, false}) {
    OccupancyGrid local = free;
    if (!seen) fill(&local, 1.1, 2.25, 1.6, 2.6, -1);
    map.set_local(local, Pose2{});
    PathTracker tracker(config);
    TrackInput input;
    input.T_map_base = {1.0, 2.0, 0.0};
    input.layer = &map.combined();
    input.map = &map;
    input.scan = &view;
    const TrackOutput out = tracker.follow(input, path);
    EXPECT_EQ(out.kind, seen ? TrackOutput::Kind::kDriving : TrackOutput::Kind::kTurning);
    EXPECT_GT(out.w_radps, 0.0);
    // Along the path it looks as far to one side as to the other: on it goes.
    input.T_map_base.yaw_rad = std::atan2(0.35, 1.0);
    EXPECT_EQ(tracker.follow(input, path).kind, TrackOutput::Kind::kDriving);
  }
}

TEST(Tracker, BeforeSomethingBesideTheWayItIsDownToTheSpeedAllowedThereAndNoSlowerBefore) {
  // A wall's end 0.30 m beside a straight way, 1.5 m ahead: 0.10 m beyond the robot's radius, where 0.25 + 0.35 (0.10 - 0.04) / (0.25 - 0.04)
  // = 0.35 m/s are allowed. From 0.6 m/s at 1 m/s^2 that takes 0.12 m of driving on and (0.36 - 0.1225) / 2 = 0.119 m of braking: the robot is
  // still fast half a metre before the wall (who looks at the least clearance within 0.6 m is not), and slow when it is there.
  PlannerTrackerConfig config;
  config.max_vel_x = 0.6;
  config.acc_lim_x = 1.0;
  config.tracking.slow_mps = 0.25;
  config.tracking.reaction_s = 0.2;
  OccupancyGrid grid = room(5.0, 4.0);
  fill(&grid, 2.5, 2.3, 2.55, 4.0, 100);
  CombinedMap map(0.6, config.clearance.occupied_threshold, config.clearance.free_threshold);
  map.set_global({}, grid, {});
  map.set_local(grid, Pose2{});
  const ScanView view = open_view();
  Path path;
  path.set({{0.5, 2.0}, {4.5, 2.0}});
  PathTracker tracker(config);
  TrackInput input;
  input.T_map_base = {0.5, 2.0, 0.0};
  input.v_mps = 0.6;
  input.layer = &map.combined();
  input.map = &map;
  input.scan = &view;
  double at_the_wall_mps = 0.0, fast_until_m = 0.0;
  while (input.T_map_base.x_m < 2.525) {
    path.advance({input.T_map_base.x_m, input.T_map_base.y_m});
    const TrackOutput out = tracker.follow(input, path);
    ASSERT_EQ(out.kind, TrackOutput::Kind::kDriving);
    input.v_mps = at_the_wall_mps = out.v_mps;
    if (out.v_mps > 0.59) fast_until_m = input.T_map_base.x_m;
    input.T_map_base.x_m += out.v_mps * input.dt_s;
  }
  EXPECT_GT(fast_until_m, 2.525 - 0.5);
  // A control step at 1 m/s^2 is 0.05 m/s; the clearance of a grid of 5 cm cells errs by 2 cm.
  EXPECT_NEAR(at_the_wall_mps, 0.35, 0.06);
}

TEST(Tracker, BesideThePathsEndAndUnableToReachItTheRobotIsBlockedAndDoesNotStandThereAsIfItDrove) {
  // The path's last 3 cm, with the robot 12 cm to their side and something 0.28 m before it on its straight way there: room for 7 cm.
  const PlannerTrackerConfig config;
  OccupancyGrid grid = room(4.0, 4.0);
  fill(&grid, 2.30, 1.5, 2.35, 2.5, 100);
  CombinedMap map(0.6, config.clearance.occupied_threshold, config.clearance.free_threshold);
  map.set_global({}, grid, {});
  const ScanView view = open_view();
  Path path;
  path.set({{2.12, 1.5}, {2.12, 2.0}});
  for (const bool room_left : {false, true}) {
    PathTracker tracker(config);
    TrackInput input;
    input.T_map_base = {room_left ? 1.7 : 2.03, 1.98, 0.0};
    input.layer = &map.combined();
    input.scan = &view;
    path.advance({input.T_map_base.x_m, input.T_map_base.y_m});
    const TrackOutput out = tracker.follow(input, path);
    EXPECT_EQ(out.kind, room_left ? TrackOutput::Kind::kDriving : TrackOutput::Kind::kBlocked);
    EXPECT_EQ(out.v_mps > 0.0, room_left);
  }
}

}  // namespace
}  // namespace knav
