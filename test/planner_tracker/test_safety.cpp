// What stops the robot: silent sensors, unknown ground, a clock that jumps; and what a lost one does.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "planner_tracker/planner_tracker.h"
#include "toy_world.h"

namespace knav {
namespace {

using testing::HasSubstr;

TEST(Safety, ADeadSensorStopsTheRobotWithin300msAndThenFailsTheGoal) {
  const OccupancyGrid grid = room(12.0, 4.0);
  ToyWorld world(grid, grid, {1.0, 2.0, 0.0});
  world.planner.set_goal({11.0, 2.0, 0.0});
  world.run(4.0);
  ASSERT_GT(world.v_mps, 0.3);
  world.sensor_alive = false;
  const double dead_s = world.now_s;
  Command command;
  do {
    command = world.step();
  } while (command.v_mps != 0.0 && world.now_s < dead_s + 2.0);
  EXPECT_LE(world.now_s - dead_s, 0.30 + 1e-6);
  EXPECT_EQ(command.w_radps, 0.0);
  EXPECT_EQ(command.activity, Activity::kStopped);
  EXPECT_THAT(world.planner.explanation(), HasSubstr("scan_360"));
  // Back in time, it goes on; never back, the goal fails.
  world.sensor_alive = true;
  world.run(2.0);
  EXPECT_GT(world.v_mps, 0.2);
  world.sensor_alive = false;
  EXPECT_EQ(world.run(30.0).activity, Activity::kFailed);
  EXPECT_EQ(world.planner.failure().code, FailureCode::kNoSensorData);
}

TEST(Safety, StaleOdometryPoseOrLocalizerStopEachWithItsOwnReason) {
  const OccupancyGrid grid = room(6.0, 4.0);
  PlannerTracker planner{PlannerTrackerConfig{}};
  planner.set_map({}, grid, {});
  RangeScan scan;
  scan.range_max_m = 6.0;
  scan.angle_min_rad = -kPi;
  scan.angle_increment_rad = 2.0 * kPi / 90;
  scan.range_m.assign(90, 1.4f);
  RobotState good;
  good.has_pose = true;
  good.T_map_base = {2.0, 2.0, 0.0};
  good.localization = LocalizationState::kOk;
  const auto at = [&](double t) {
    scan.stamp_s = t;
    planner.set_scan(scan, Pose2{});
    RobotState s = good;
    s.odom_stamp_s = s.pose_stamp_s = s.localization_stamp_s = t;
    return s;
  };
  planner.set_goal({4.5, 2.0, 0.0});
  double t = 10.0;
  EXPECT_EQ(planner.step(t, at(t)).activity, Activity::kDriving);
  const auto expect_stop = [&](const RobotState& state, const char* word) {
    const Command command = planner.step(t, state);
    EXPECT_EQ(command.activity, Activity::kStopped) << word;
    EXPECT_EQ(command.v_mps, 0.0);
    EXPECT_EQ(command.w_radps, 0.0);
    EXPECT_THAT(planner.explanation(), HasSubstr(word));
  };
  RobotState s = at(t += 0.05);
  s.odom_stamp_s -= 0.6;
  expect_stop(s, "odometry");
  s = at(t += 0.05);
  s.pose_stamp_s -= 0.6;
  expect_stop(s, "transform");
  s = at(t += 0.05);
  s.localization_stamp_s -= 3.5;
  expect_stop(s, "silent");
  s = at(t += 0.05);
  s.has_pose = false;
  expect_stop(s, "transform");
  s = at(t += 0.05);
  s.T_map_base.x_m = std::nan("");
  expect_stop(s, "finite");
  s = at(t += 0.05);
  EXPECT_NE(planner.step(t, s).activity, Activity::kStopped);
  planner.cancel();
  const Command cancelled = planner.step(t + 0.05, at(t + 0.05));
  EXPECT_EQ(cancelled.v_mps, 0.0);
  EXPECT_EQ(cancelled.activity, Activity::kIdle);
}

TEST(Safety, SurroundedByUnknownTheRobotDoesNotDriveIntoIt) {
  OccupancyGrid map = room(8.0, 6.0);
  fill(&map, 1.0, 1.0, 5.0, 5.0, -1);
  ToyWorld world(room(8.0, 6.0), map, {3.0, 3.0, 0.0});
  world.memory_range_m = 0.0;  // and nothing is seen
  world.planner.set_goal({7.0, 3.0, 0.0});
  EXPECT_EQ(world.run(100.0).activity, Activity::kFailed);
  EXPECT_EQ(world.planner.failure().code, FailureCode::kStartOccupied);
  EXPECT_LT(world.distance_to({3.0, 3.0, 0.0}), 0.25);
}

TEST(Safety, AClockThatJumpsBackEndsTheGoal) {
  const OccupancyGrid grid = room(12.0, 4.0);
  ToyWorld world(grid, grid, {1.0, 2.0, 0.0});
  world.planner.set_goal({11.0, 2.0, 0.0});
  world.run(3.0);
  world.now_s -= 50.0;
  const Command command = world.step();
  EXPECT_EQ(command.activity, Activity::kFailed);
  EXPECT_EQ(command.v_mps, 0.0);
  EXPECT_THAT(world.planner.failure().reason, HasSubstr("clock"));
  // And everything works again afterwards.
  world.planner.set_goal({11.0, 2.0, 0.0});
  EXPECT_EQ(world.run(60.0).activity, Activity::kReached);
}

TEST(Recovery, ALostRobotLooksRoundWandersFartherEachTimeAndGoesOnWhenFound) {
  const OccupancyGrid grid = room(8.0, 6.0);
  PlannerTrackerConfig config;
  config.recovery.wander_radius_m = 0.8;
  ToyWorld world(grid, grid, {4.0, 3.0, 0.0}, config);
  world.planner.set_goal({7.0, 5.0, 0.0});
  world.run(2.0);
  world.localization = LocalizationState::kLost;
  bool turned = false;
  const Pose2 there = world.T_map_base;
  int rounds = 0;
  double farthest = 0.0, most_beyond = 0.0;
  Activity before = Activity::kDriving;
  for (int i = 0; i < 1800; ++i) {
    const Command command = world.step();
    ASSERT_FALSE(command.finished);
    turned |= command.activity == Activity::kLostTurning;
    if (command.activity == Activity::kLostWandering && before == Activity::kLostTurning) ++rounds;
    before = command.activity;
    farthest = std::max(farthest, world.distance_to(there));
    most_beyond = std::max(most_beyond, world.distance_to(there) - 0.8 * std::max(1, rounds));
  }
  EXPECT_TRUE(turned);
  EXPECT_GE(rounds, 3);
  EXPECT_GT(farthest, 1.0);
  EXPECT_LT(most_beyond, 0.05) << "brakes at the end of a move";
  world.localization = LocalizationState::kOk;
  EXPECT_EQ(world.run(60.0).activity, Activity::kReached);
  EXPECT_EQ(world.collisions, 0);
}

TEST(Recovery, InDoubtItWaitsAtTheGoalForTheLocalizerToBeSureOrToFindItElsewhere) {
  const OccupancyGrid grid = room(8.0, 4.0);
  double took_s[2];
  for (const bool doubts : {false, true}) {
    ToyWorld world(grid, grid, {2.0, 2.0, 0.0});
    if (doubts) world.localization = LocalizationState::kUncertain;
    world.planner.set_goal({3.0, 2.0, 0.0});
    const double began_s = world.now_s;
    ASSERT_EQ(world.run(60.0).activity, Activity::kReached);
    took_s[doubts] = world.now_s - began_s;
  }
  EXPECT_GT(took_s[true], took_s[false] + 5.0);
  EXPECT_LT(took_s[true], took_s[false] + 10.0);
}

TEST(Recovery, APlaceJustJumpedToIsNotDrivenOnFromUntilTheLocalizerIsSure) {
  const OccupancyGrid grid = room(20.0, 6.0);
  ToyWorld world(grid, grid, {2.0, 3.0, 0.0});
  world.planner.set_goal({16.0, 3.0, 0.0});
  world.run(3.0);
  const Pose2 T_odom_base = world.T_map_odom.inverse() * world.T_map_base;
  world.T_map_base = {14.0, 3.0, 0.0};  // it says; 2 m before the goal
  world.T_map_odom = world.T_map_base * T_odom_base.inverse();
  world.localization = LocalizationState::kUncertain;
  const Command command = world.run(60.0);
  EXPECT_FALSE(command.finished) << "neither there nor given up";
  EXPECT_TRUE(command.activity == Activity::kLostTurning || command.activity == Activity::kLostWandering);
  world.localization = LocalizationState::kOk;
  EXPECT_EQ(world.run(60.0).activity, Activity::kReached);
}

TEST(Recovery, CarriedOffItHasTheTimeThatTheWayFromThereTakes) {
  const OccupancyGrid grid = room(70.0, 4.0);
  ToyWorld world(grid, grid, {1.0, 2.0, 0.0});
  world.planner.set_goal({4.0, 2.0, 0.0});  // 3 m: 85 s
  world.run(3.0);
  const Pose2 T_odom_base = world.T_map_odom.inverse() * world.T_map_base;
  world.T_map_base = {68.0, 2.0, kPi};
  world.T_map_odom = world.T_map_base * T_odom_base.inverse();
  const double carried_off_s = world.now_s;
  const Command command = world.run(300.0);
  EXPECT_EQ(command.activity, Activity::kReached) << world.planner.failure().reason;
  EXPECT_GT(world.now_s - carried_off_s, 95.0) << "or this tests nothing";
}

TEST(Recovery, ALocalizerThatJumpsForEverDoesNotKeepAGoalForEver) {
  const OccupancyGrid grid = room(70.0, 4.0);
  ToyWorld world(grid, grid, {1.0, 2.0, 0.0});
  world.planner.set_goal({4.0, 2.0, 0.0});
  Command command;
  for (int k = 0; k < 150 && !command.finished; ++k) {
    command = world.run(4.0);
    const Pose2 T_odom_base = world.T_map_odom.inverse() * world.T_map_base;
    world.T_map_base = {k % 2 == 0 ? 68.0 : 40.0, 2.0, kPi};
    world.T_map_odom = world.T_map_base * T_odom_base.inverse();
  }
  EXPECT_EQ(command.activity, Activity::kFailed);
}

TEST(Recovery, NeverFoundFailsAsLost) {
  const OccupancyGrid grid = room(8.0, 6.0);
  PlannerTrackerConfig config;
  config.recovery.lost_timeout_s = 20.0;
  ToyWorld world(grid, grid, {4.0, 3.0, 0.0}, config);
  world.planner.set_goal({7.0, 5.0, 0.0});
  world.localization = LocalizationState::kLost;
  EXPECT_EQ(world.run(40.0).activity, Activity::kFailed);
  EXPECT_EQ(world.planner.failure().code, FailureCode::kLost);
}

TEST(Recovery, MapsThatShiftAgainstEachOtherDoNotFlipTheWay) {
  // A pillar exactly on the line: left and right are equally long, and the pose swings by 4 cm each second.
  OccupancyGrid grid = room(10.0, 5.0);
  fill(&grid, 4.5, 2.0, 5.5, 3.0, 100);
  ToyWorld world(grid, grid, {1.0, 2.5, 0.0});
  world.pose_noise_m = 0.03;
  world.planner.set_goal({9.0, 2.5, 0.0});
  EXPECT_EQ(world.run(60.0).activity, Activity::kReached);
  EXPECT_LT(world.driven_m, 9.2);
  EXPECT_EQ(world.avoidances, 0);
  EXPECT_EQ(world.collisions, 0);
}

}  // namespace
}  // namespace knav
