// A robot driven to goals in a world that is as its map says, and goals that are refused.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "core/error.h"
#include "planner_tracker/planner_tracker.h"
#include "toy_world.h"
#include "two_rooms.h"

namespace knav {
namespace {

void expect_at(const ToyWorld& world, const Pose2& goal) {
  EXPECT_LT(world.distance_to(goal), 0.07);
  EXPECT_LT(std::abs(normalize_angle_rad(world.T_map_base.yaw_rad - goal.yaw_rad)), 0.12);
}

TEST(Drive, SeveralGoalsThroughDoorsAtSpeedWithoutTouching) {
  const OccupancyGrid grid = two_rooms();
  ToyWorld world(grid, grid, {1.0, 1.0, 2.0});
  const double began_s = world.now_s;
  for (const Pose2& goal :
       {Pose2{10.5, 4.5, 1.0}, Pose2{1.0, 5.0, -2.0}, Pose2{11.0, 1.0, 3.1}, Pose2{3.0, 3.0, 0.0}}) {
    ASSERT_TRUE(world.planner.set_goal(goal));
    const Command command = world.run(90.0);
    ASSERT_EQ(command.activity, Activity::kReached) << world.planner.failure().reason;
    expect_at(world, goal);
  }
  EXPECT_EQ(world.collisions, 0);
  EXPECT_EQ(world.avoidances, 0);
  EXPECT_LE(world.reversals, 2);
  EXPECT_LE(world.max_v_mps, 0.6 + 1e-9);
  EXPECT_LE(world.max_w_radps, 1.2 + 1e-9);
  EXPECT_GT(world.driven_m / (world.now_s - began_s), 0.40)
      << "mean speed, turns and four alignments included";
  std::printf("mean speed %.3f m/s, %.3f ms a step\n", world.driven_m / (world.now_s - began_s),
              world.planner_ms / world.steps);
  RecordProperty("mean_speed_mps", std::to_string(world.driven_m / (world.now_s - began_s)));
}

TEST(Drive, TurnsInPlaceFirstWhenThePathStartsBehind) {
  const OccupancyGrid grid = room(8.0, 4.0);
  ToyWorld world(grid, grid, {4.0, 2.0, 0.0});
  world.planner.set_goal({1.0, 2.0, kPi});
  for (int i = 0; i < 40; ++i) {
    const Command command = world.step();
    if (std::abs(normalize_angle_rad(world.T_map_base.yaw_rad - kPi)) > 0.7) {
      ASSERT_EQ(command.v_mps, 0.0);
    }
  }
  EXPECT_EQ(world.run(30.0).activity, Activity::kReached);
}

TEST(Drive, CommandsKeepAccelerationLimits) {
  const OccupancyGrid grid = two_rooms();
  PlannerTrackerConfig config;
  config.acc_lim_x = 0.4;
  config.tracking.stop_decel_mps2 = 1.0;
  config.acc_lim_theta = 2.5;
  ToyWorld world(grid, grid, {1.0, 1.0, -1.0}, config);
  world.planner.set_goal({10.5, 1.5, 0.0});
  Command last, command;
  for (int i = 0; i < 1200 && !command.finished; ++i) {
    command = world.step();
    EXPECT_LE(command.v_mps - last.v_mps, 0.4 * 0.05 + 1e-9);
    EXPECT_GE(command.v_mps - last.v_mps, -1.0 * 0.05 - 1e-9);
    EXPECT_LE(std::abs(command.w_radps - last.w_radps), 2.5 * 0.05 + 1e-9);
    last = command;
  }
  EXPECT_EQ(command.activity, Activity::kReached);
}

TEST(Drive, SameCallsGiveTheSameCommands) {
  const OccupancyGrid grid = two_rooms();
  std::vector<double> v[2];
  for (auto& record : v) {
    ToyWorld world(grid, grid, {1.0, 1.0, 0.0});
    world.discs.push_back({[](double t) { return Point2{6.0, 1.0 + 0.9 * std::abs(std::sin(0.2 * t))}; }});
    world.planner.set_goal({10.5, 4.5, 1.0});
    for (int i = 0; i < 800; ++i) {
      const Command command = world.step();
      record.push_back(command.v_mps);
      record.push_back(command.w_radps);
    }
  }
  EXPECT_EQ(v[0], v[1]);
}

TEST(Goal, StandingAtTheGoalCmdVelStaysZeroThoughThePoseWanders) {
  const OccupancyGrid grid = room(6.0, 4.0);
  ToyWorld world(grid, grid, {1.0, 2.0, 0.0});
  world.planner.set_goal({4.0, 2.0, 1.5});
  ASSERT_EQ(world.run(40.0).activity, Activity::kReached);
  world.pose_noise_m = 0.05;
  for (int i = 0; i < 400; ++i) {
    const Command command = world.step();
    ASSERT_EQ(command.v_mps, 0.0);
    ASSERT_EQ(command.w_radps, 0.0);
    ASSERT_EQ(command.activity, Activity::kIdle);
  }
}

TEST(Goal, ReachedUnderANoisyPoseWithoutDancing) {
  const OccupancyGrid grid = room(8.0, 6.0);
  for (int i = 0; i < 6; ++i) {
    ToyWorld world(grid, grid, {1.0, 1.0 + 0.5 * i, 0.3 * i});
    world.pose_noise_m = 0.015;
    const Pose2 goal{5.0 + 0.1 * i, 4.0 - 0.3 * i, -3.0 + i};
    world.planner.set_goal(goal);
    ASSERT_EQ(world.run(40.0).activity, Activity::kReached) << i;
    EXPECT_LT(world.distance_to(goal), 0.09) << i;
    EXPECT_LE(world.reversals, 2) << i;
  }
}

TEST(Goal, WhatTheLocalizerCorrectsWhileTheRobotTurnsAtItIsMadeGood) {
  const OccupancyGrid grid = room(8.0, 6.0);
  for (const int corrections : {0, 1}) {
    PlannerTrackerConfig config;
    config.goal_corrections = corrections;
    ToyWorld world(grid, grid, {2.0, 3.0, 0.0}, config);
    world.pose_noise_m = 0.0;  // so that the tolerance holds in truth
    const Pose2 goal{5.0, 3.0, 0.5 * kPi};
    world.planner.set_goal(goal);
    Command command;
    while (!command.finished && command.activity != Activity::kAligning) command = world.step();
    const Pose2 T_odom_base = world.T_map_odom.inverse() * world.T_map_base;
    world.T_map_base.x_m += 0.09;
    world.T_map_odom = world.T_map_base * T_odom_base.inverse();
    EXPECT_EQ(world.run(60.0).activity, Activity::kReached) << corrections;
    if (corrections == 0) {
      EXPECT_GT(world.distance_to(goal), 0.06);
    } else {
      EXPECT_LT(world.distance_to(goal), 0.05);
    }
    EXPECT_LT(std::abs(normalize_angle_rad(world.T_map_base.yaw_rad - goal.yaw_rad)), 0.1);
  }
}

TEST(Refused, GoalsThatCannotBe) {
  OccupancyGrid grid = two_rooms();
  fill(&grid, 1.0, 4.0, 2.0, 5.0, -1);
  fill(&grid, 5.95, 0.0, 6.05, 6.0, 100);
  ToyWorld world(grid, grid, {1.0, 1.0, 0.0});
  EXPECT_FALSE(world.planner.set_goal({std::nan(""), 0.0, 0.0}));
  EXPECT_EQ(world.planner.failure().code, FailureCode::kGoalInvalid);
  EXPECT_FALSE(world.planner.has_goal());
  const struct {
    Pose2 goal;
    FailureCode code;
  } cases[] = {{{6.0, 3.0, 0.0}, FailureCode::kGoalOccupied},
               {{1.5, 4.5, 0.0}, FailureCode::kGoalUnknown},
               {{50.0, 3.0, 0.0}, FailureCode::kGoalUnknown},
               {{9.0, 3.0, 0.0}, FailureCode::kNoPath}};
  for (const auto& c : cases) {
    ASSERT_TRUE(world.planner.set_goal(c.goal));
    EXPECT_EQ(world.run(2.0).activity, Activity::kFailed);
    EXPECT_EQ(world.planner.failure().code, c.code);
    EXPECT_THAT(world.planner.failure().reason, testing::EndsWith("."));
  }
  EXPECT_EQ(world.driven_m, 0.0);
}

/// Two rooms joined by one gap.
OccupancyGrid rooms_with_gap(double low_m, double high_m) {
  OccupancyGrid grid = room(12.0, 6.0);
  fill(&grid, 5.95, 0.0, 6.05, 6.0, 100);
  fill(&grid, 5.95, low_m, 6.05, high_m, 0);
  return grid;
}

TEST(NarrowWay, ThatOnlyTheMapMakesTooNarrowIsTriedWhereNothingElseLeads) {
  // The gap is 0.6 m wide, in the map 0.45 m: too narrow for 0.4 m and 6 cm on either side, but not for 3 cm.
  PlannerTrackerConfig config;
  config.clearance.hard_m = 0.06;
  for (int shift = 0; shift < 3; ++shift) {
    const double low = 2.5 + 0.05 * shift;
    const OccupancyGrid truth = rooms_with_gap(low, low + 0.6), map = rooms_with_gap(low + 0.05, low + 0.5);
    GridPlanner as_wide_as_ever(config);
    CombinedMap layers(config.preferred_radius_m() + 0.2, 65, 25);
    layers.set_global({}, map, {});
    as_wide_as_ever.set_map(layers.global());
    PlanResult result;
    as_wide_as_ever.plan(layers.global(), {2.0, 1.0}, {10.0, 4.0}, &result);
    ASSERT_EQ(result.code, PlanCode::kNoPath);

    ToyWorld world(truth, map, {2.0, 1.0, 0.0}, config);
    const Pose2 goal{10.0, 4.0, 0.0};
    EXPECT_EQ(world.planner.make_plan({2.0, 1.0}, {goal.x_m, goal.y_m}, 0.0).code, PlanCode::kOk);
    ASSERT_TRUE(world.planner.set_goal(goal));
    ASSERT_EQ(world.run(90.0).activity, Activity::kReached) << world.planner.failure().reason;
    expect_at(world, goal);
    ASSERT_TRUE(world.planner.set_goal({2.0, 5.0, 0.0}));  // out again
    EXPECT_EQ(world.run(90.0).activity, Activity::kReached) << world.planner.failure().reason;
    EXPECT_EQ(world.collisions, 0);
  }
}

TEST(NarrowWay, NarrowerThanTheRobotIsRefusedAtOnce) {
  const OccupancyGrid grid = rooms_with_gap(2.5, 2.85);
  ToyWorld world(grid, grid, {2.0, 1.0, 0.0});
  ASSERT_TRUE(world.planner.set_goal({10.0, 4.0, 0.0}));
  EXPECT_EQ(world.run(2.0).activity, Activity::kFailed);
  EXPECT_EQ(world.planner.failure().code, FailureCode::kNoPath);
}

TEST(NarrowWay, TheTrackerRefusesTwiceItGoesRound) {
  // Just as wide as the map's planning takes for enough, and too narrow to keep 3 cm on either side.
  OccupancyGrid grid = rooms_with_gap(2.5, 2.95);
  fill(&grid, 5.95, 4.8, 6.05, 5.7, 0);  // another door
  ToyWorld world(grid, grid, {4.0, 2.7, 0.0});
  const PlanResult plan = world.planner.make_plan({4.0, 2.7}, {8.0, 2.7}, 0.0);
  ASSERT_EQ(plan.code, PlanCode::kOk);
  ASSERT_LT(plan.length_m, 4.5);
  ASSERT_TRUE(world.planner.set_goal({8.0, 2.7, 0.0}));
  ASSERT_EQ(world.run(120.0).activity, Activity::kReached) << world.planner.failure().reason;
  EXPECT_EQ(world.collisions, 0);
  EXPECT_GT(world.driven_m, 6.0);
}

TEST(Config, ContradictionsAreRefused) {
  PlannerTrackerConfig config;
  config.clearance.preferred_m = 0.01;
  EXPECT_THROW(PlannerTracker{config}, UserError);
  EXPECT_TRUE(PlannerTrackerConfig{}.validate().empty());
}

}  // namespace
}  // namespace knav
