#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "planner_tracker/planner_tracker.h"
#include "toy_world.h"

namespace knav {
namespace {

using testing::HasSubstr;

/// Two rooms of 6 x 6 m side by side, joined by a door of 0.9 m below and one above.
OccupancyGrid two_rooms() {
  OccupancyGrid grid = room(12.0, 6.0);
  fill(&grid, 5.95, 0.0, 6.05, 6.0, 100);
  fill(&grid, 5.95, 1.0, 6.05, 1.9, 0);
  fill(&grid, 5.95, 4.3, 6.05, 5.2, 0);
  return grid;
}

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
  ToyWorld world(grid, grid, {1.0, 1.0, -1.0});
  world.planner.set_goal({10.5, 1.5, 0.0});
  Command last, command;
  for (int i = 0; i < 1200 && !command.finished; ++i) {
    command = world.step();
    EXPECT_LE(command.v_mps - last.v_mps, 0.6 * 0.05 + 1e-9);
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

TEST(Obstacles, ABlockedDoorIsReplannedRound) {
  const OccupancyGrid map = two_rooms();
  OccupancyGrid truth = map;
  fill(&truth, 5.95, 1.0, 6.05, 1.9, 100);  // the lower door is shut
  ToyWorld world(truth, map, {1.5, 1.5, 0.0});
  world.planner.set_goal({10.5, 1.5, 0.0});
  const Command command = world.run(120.0);
  EXPECT_EQ(command.activity, Activity::kReached) << world.planner.failure().reason;
  EXPECT_EQ(world.collisions, 0);
  EXPECT_LE(world.driven_m, 25.0);
}

TEST(Obstacles, BothDoorsShutGivesUpWithTheDoorAsReasonWithin60sOfStanding) {
  const OccupancyGrid map = two_rooms();
  OccupancyGrid truth = map;
  fill(&truth, 5.95, 0.0, 6.05, 6.0, 100);
  ToyWorld world(truth, map, {1.5, 1.5, 0.0});
  world.planner.set_goal({10.5, 1.5, 0.0});
  const Command command = world.run(150.0);
  ASSERT_EQ(command.activity, Activity::kFailed);
  EXPECT_EQ(world.planner.failure().code, FailureCode::kBlocked);
  EXPECT_NEAR(world.planner.failure().at.x_m, 6.0, 0.6);
  EXPECT_THAT(world.planner.failure().reason, HasSubstr("closed"));
  EXPECT_EQ(world.collisions, 0);
  EXPECT_EQ(command.v_mps, 0.0);
}

TEST(Obstacles, ADoorThatWasShutInTheMapAndIsOpenIsUsedOnceSeen) {
  const OccupancyGrid truth = two_rooms();
  OccupancyGrid map = truth;
  fill(&map, 5.95, 1.0, 6.05, 1.9, 100);
  ToyWorld world(truth, map, {3.0, 1.45, 0.0});
  world.planner.set_goal({9.0, 1.45, 0.0});
  EXPECT_EQ(world.run(60.0).activity, Activity::kReached);
  EXPECT_LT(world.driven_m, 8.0);
}

TEST(Obstacles, APersonStandingInThePathIsPassed) {
  const OccupancyGrid grid = room(10.0, 3.0);
  ToyWorld world(grid, grid, {1.0, 1.5, 0.0});
  world.discs.push_back({[](double) { return Point2{5.0, 1.45}; }});
  world.planner.set_goal({9.0, 1.5, 0.0});
  EXPECT_EQ(world.run(60.0).activity, Activity::kReached) << world.planner.failure().reason;
  EXPECT_EQ(world.collisions, 0);
}

TEST(Obstacles, APersonWhoFillsTheCorridorIsWaitedFor) {
  const OccupancyGrid grid = room(10.0, 1.2);
  ToyWorld world(grid, grid, {1.0, 0.6, 0.0});
  const double leaves_s = world.now_s + 20.0;
  world.discs.push_back({[=](double t) { return t < leaves_s ? Point2{5.0, 0.6} : Point2{-5.0, 0.6}; }});
  world.planner.set_goal({9.0, 0.6, 0.0});
  EXPECT_EQ(world.run(100.0).activity, Activity::kReached) << world.planner.failure().reason;
  EXPECT_GT(world.now_s, leaves_s);
  EXPECT_EQ(world.collisions, 0);
}

TEST(Obstacles, WalkersAreNotRunInto) {
  const OccupancyGrid grid = two_rooms();
  ToyWorld world(grid, grid, {1.0, 1.5, 0.0});
  // Walkers who cross and come along the way, and stop rather than walk into the robot.
  std::vector<Point2> at{{4.0, 4.0}, {8.5, 0.6}, {10.0, 3.0}};
  std::vector<Point2> speed{{0.0, -0.7}, {0.15, 0.6}, {-0.8, 0.0}};
  double last_s = world.now_s;
  const auto walk = [&](double t) {
    const double dt = t - last_s;
    last_s = t;
    for (std::size_t i = 0; i < at.size(); ++i) {
      const Point2 next{at[i].x_m + speed[i].x_m * dt, at[i].y_m + speed[i].y_m * dt};
      if (std::hypot(next.x_m - world.T_map_base.x_m, next.y_m - world.T_map_base.y_m) < 0.65) continue;
      at[i] = next;
      if (at[i].y_m < 0.5 || at[i].y_m > 5.5) speed[i].y_m = std::copysign(speed[i].y_m, 3.0 - at[i].y_m);
      const double left = i == 0 ? 0.5 : 6.5, right = i == 0 ? 5.5 : 11.5;
      if (at[i].x_m < left || at[i].x_m > right)
        speed[i].x_m = std::copysign(speed[i].x_m, 0.5 * (left + right) - at[i].x_m);
    }
  };
  for (std::size_t i = 0; i < at.size(); ++i) {
    world.discs.push_back({[&, i](double t) {
      if (i == 0 && t > last_s) walk(t);
      return at[i];
    }});
  }
  for (const Pose2& goal :
       {Pose2{10.5, 4.5, 1.0}, Pose2{1.0, 5.0, -2.0}, Pose2{11.0, 1.0, 3.1}, Pose2{2.0, 2.0, 0.0}}) {
    world.planner.set_goal(goal);
    EXPECT_EQ(world.run(150.0).activity, Activity::kReached) << world.planner.failure().reason;
  }
  EXPECT_EQ(world.collisions, 0);
}

TEST(Obstacles, SomethingOnTheGoalIsApproachedThenGivenUpWithThePoint) {
  const OccupancyGrid map = room(8.0, 5.0);
  OccupancyGrid truth = map;
  fill(&truth, 5.7, 2.2, 6.3, 2.8, 100);
  ToyWorld world(truth, map, {1.0, 2.5, 0.0});
  world.planner.set_goal({6.0, 2.5, 0.0});
  double nearest_m = 1e9;
  Command command;
  for (int i = 0; i < 2000 && !command.finished; ++i) {
    command = world.step();
    nearest_m = std::min(nearest_m, world.distance_to({6.0, 2.5, 0.0}));
  }
  ASSERT_EQ(command.activity, Activity::kFailed);
  EXPECT_EQ(world.planner.failure().code, FailureCode::kBlocked);
  // Where the robot's middle comes to its nearest, a radius before a face of the box, or in the box.
  EXPECT_NEAR(world.planner.failure().at.x_m, 6.0, 0.3 + 0.25 + 0.05) << world.planner.failure().reason;
  EXPECT_NEAR(world.planner.failure().at.y_m, 2.5, 0.3 + 0.25 + 0.05) << world.planner.failure().reason;
  EXPECT_LT(nearest_m, 1.2);
  EXPECT_LT(world.distance_to({6.0, 2.5, 0.0}), 1.25 * PlannerTrackerConfig{}.planning.look_distance_m + 0.2);
  EXPECT_EQ(world.collisions, 0);
}

TEST(Obstacles, SomebodyWhoLeavesTheGoalIsSeenToHaveLeftFromFartherOff) {
  const OccupancyGrid grid = room(8.0, 5.0);
  ToyWorld world(grid, grid, {1.0, 2.5, 0.0});
  world.sees_free_from_m = 1.3;
  const double leaves_s = world.now_s + 20.0;
  world.discs.push_back({[=](double t) { return t < leaves_s ? Point2{6.0, 2.5} : Point2{-5.0, 0.0}; }});
  world.planner.set_goal({6.0, 2.5, 0.0});
  EXPECT_EQ(world.run(80.0).activity, Activity::kReached) << world.planner.failure().reason;
  EXPECT_EQ(world.collisions, 0);
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

TEST(Recovery, ALostRobotLooksRoundWandersAndGoesOnWhenFound) {
  const OccupancyGrid grid = room(8.0, 6.0);
  ToyWorld world(grid, grid, {4.0, 3.0, 0.0});
  world.planner.set_goal({7.0, 5.0, 0.0});
  world.run(2.0);
  world.localization = LocalizationState::kLost;
  bool turned = false, wandered = false;
  const Pose2 there = world.T_map_base;
  double farthest = 0.0;
  for (int i = 0; i < 1400; ++i) {
    const Command command = world.step();
    ASSERT_FALSE(command.finished);
    turned |= command.activity == Activity::kLostTurning;
    wandered |= command.activity == Activity::kLostWandering && command.v_mps > 0.05;
    farthest = std::max(farthest, world.distance_to(there));
  }
  EXPECT_TRUE(turned);
  EXPECT_TRUE(wandered);
  EXPECT_LT(farthest, 3.5);
  world.localization = LocalizationState::kOk;
  EXPECT_EQ(world.run(60.0).activity, Activity::kReached);
  EXPECT_EQ(world.collisions, 0);
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

TEST(Config, ContradictionsAreRefused) {
  PlannerTrackerConfig config;
  config.clearance.preferred_m = 0.01;
  EXPECT_THROW(PlannerTracker{config}, UserError);
  EXPECT_TRUE(PlannerTrackerConfig{}.validate().empty());
}

}  // namespace
}  // namespace knav
