// What stands or walks in the way and is not in the map.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "planner_tracker/planner_tracker.h"
#include "toy_world.h"
#include "two_rooms.h"

namespace knav {
namespace {

using testing::HasSubstr;

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

}  // namespace
}  // namespace knav
