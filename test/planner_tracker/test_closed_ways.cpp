// A way that is closed for now: from where the robot looks at it, and that it does not stay where it cannot see.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "planner_tracker/plan_keeper.h"
#include "planner_tracker/planner_tracker.h"
#include "toy_world.h"

namespace knav {
namespace {

/// Two rooms of 6 x 6 m side by side, joined by one door of 0.9 m.
OccupancyGrid two_rooms(bool open) {
  OccupancyGrid grid = room(12.0, 6.0);
  fill(&grid, 5.95, 0.0, 6.05, 6.0, 100);
  if (open) fill(&grid, 5.95, 2.5, 6.05, 3.4, 0);
  return grid;
}

/// Where the way ends that the keeper makes of a door found shut.
Point2 end_of_way(const Point2& robot, Point2* closed_at) {
  const PlannerTrackerConfig config;
  CombinedMap map(config.preferred_radius_m() + 0.2, config.clearance.occupied_threshold, config.clearance.free_threshold);
  map.set_global({}, two_rooms(true), {});
  map.set_local(two_rooms(false), Pose2{});
  PlanKeeper keeper(config);
  keeper.set_map(map);
  EXPECT_EQ(keeper.replan(map, {robot.x_m, robot.y_m, 0.0}, {10.0, 3.0}, 100.0), PlanKeeper::Outcome::kToBlockage);
  *closed_at = keeper.at();
  return keeper.path().end();
}

double distance(const Point2& a, const Point2& b) { return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m); }

TEST(ClosedWay, IsLookedAtFromAfar) {
  Point2 at;
  const Point2 end = end_of_way({1.5, 3.0}, &at);
  EXPECT_NEAR(at.x_m, 5.7, 0.15);  // the wall's face less the robot's radius and hard_m
  EXPECT_NEAR(distance(end, at), PlannerTrackerConfig{}.planning.look_distance_m, 0.1);
}

TEST(ClosedWay, IsLeftAloneByARobotThatStandsTooNear) {
  Point2 at;
  const Point2 end = end_of_way({5.3, 3.0}, &at);
  EXPECT_GT(distance(end, at), 0.9 * PlannerTrackerConfig{}.planning.look_distance_m);
  EXPECT_LT(distance(end, at), 1.5 * PlannerTrackerConfig{}.planning.look_distance_m);
  EXPECT_LT(end.x_m, 5.6) << "on this side of the door";
}

TEST(ClosedWay, AThingInTheWayThatCanBePassedIsNotWhatClosesIt) {
  // A box lies on the straight way to a door that is shut. What is to be looked at is the door: a robot that took the box for it stood
  // before the box, in a lane that was open, and gave up.
  OccupancyGrid map = room(12.0, 6.0);
  fill(&map, 8.95, 0.0, 9.05, 6.0, 100);
  OccupancyGrid shut = map;
  fill(&map, 8.95, 2.5, 9.05, 3.5, 0);
  for (const double box_y_m : {2.6, 2.8, 3.0}) {
    OccupancyGrid now = shut;
    fill(&now, 4.0, box_y_m, 4.4, box_y_m + 0.4, 100);
    const PlannerTrackerConfig config;
    CombinedMap combined(config.preferred_radius_m() + 0.2, config.clearance.occupied_threshold, config.clearance.free_threshold);
    combined.set_global({}, map, {});
    combined.set_local(now, Pose2{});
    PlanKeeper keeper(config);
    keeper.set_map(combined);
    ASSERT_EQ(keeper.replan(combined, {2.0, 3.0, 0.0}, {11.0, 3.0}, 100.0), PlanKeeper::Outcome::kToBlockage);
    EXPECT_NEAR(keeper.at().x_m, 8.7, 0.15) << box_y_m;
    EXPECT_NEAR(distance(keeper.path().end(), keeper.at()), config.planning.look_distance_m, 0.1) << box_y_m;
  }
}

TEST(ClosedWay, ADoorFoundShutIsLookedAtAgainFromBeforeItAndNotAlongTheWall) {
  // A corridor with two doors in its upper wall, into one room. Both are shut; along the corridor a camera sees a door only at a
  // sharp angle, whether it is open or not.
  for (const double other_m : {9.0, 6.0}) {  // far enough to wait for the near one, and not
    OccupancyGrid map = room(14.0, 8.0);
    fill(&map, 0.0, 2.95, 14.0, 3.05, 100);
    OccupancyGrid seen = map;
    for (const double x : {4.0, other_m}) fill(&map, x - 0.45, 2.95, x + 0.45, 3.05, 0);
    PlannerTrackerConfig config;
    CombinedMap combined(config.preferred_radius_m() + 0.2, 65, 25);
    combined.set_global({}, map, {});
    PlanKeeper keeper(config);
    keeper.set_map(combined);
    const Point2 goal{6.5, 6.0};
    OccupancyGrid near_shut = map;
    fill(&near_shut, 3.55, 2.95, 4.45, 3.05, 100);
    combined.set_local(map, {});
    keeper.replan(combined, {1.5, 1.5, 0.0}, goal, 100.0, {});
    // The near one is found shut, held for a moment, and given up for the other.
    combined.set_local(near_shut, {});
    for (double t = 101.0; t < 101.5 + config.planning.hold_s + 1.0; t += 0.5) keeper.replan(combined, {1.5, 1.5, 0.0}, goal, t, {});
    // That is shut as well. After a look at it from the corridor's far end, back to the first: straight before it.
    combined.set_local(seen, {});
    const Pose2 robot{other_m + 2.5, 1.5, kPi};
    keeper.replan(combined, robot, goal, 110.0, {});
    keeper.look_elsewhere();
    keeper.replan(combined, robot, goal, 116.0, {});
    ASSERT_NEAR(keeper.at().x_m, 4.0, 0.6);
    const Point2 end = keeper.path().end();
    EXPECT_GT(std::atan2(keeper.at().y_m - end.y_m, std::abs(keeper.at().x_m - end.x_m)), 0.8) << end.x_m << ", " << end.y_m;
  }
}

TEST(ClosedWay, IsLookedAtFromElsewhereIfNothingIsSeenFromHereAndGivenUpInTimeAllTheSame) {
  // A door that is shut, seen from a room: the robot looks from two places at least, and does not go on like that for ever.
  ToyWorld world(two_rooms(false), two_rooms(true), {1.5, 3.0, 0.0});
  world.planner.set_goal({10.0, 3.0, 0.0});
  const double began_s = world.now_s;
  std::vector<Point2> stood;
  Command command;
  for (int i = 0; i < 2400 && !command.finished; ++i) {
    command = world.step();
    const Point2 p{world.T_map_base.x_m, world.T_map_base.y_m};
    if (command.activity != Activity::kWaiting || std::abs(world.v_mps) > 0.01) continue;
    if (stood.empty() || distance(stood.back(), p) > 0.4) stood.push_back(p);
  }
  ASSERT_EQ(command.activity, Activity::kFailed);
  EXPECT_EQ(world.planner.failure().code, FailureCode::kBlocked);
  EXPECT_NEAR(world.planner.failure().at.x_m, 5.7, 0.3);
  EXPECT_GE(stood.size(), 2u);
  EXPECT_LT(world.now_s - began_s, 60.0);
  EXPECT_EQ(world.collisions, 0);
}

/// Two rooms of 6 x 6 m side by side, joined by a door below and one above.
OccupancyGrid rooms_with_two_doors(bool lower_open) {
  OccupancyGrid grid = room(12.0, 6.0);
  fill(&grid, 5.95, 0.0, 6.05, 6.0, 100);
  if (lower_open) fill(&grid, 5.95, 0.6, 6.05, 1.5, 0);
  fill(&grid, 5.95, 4.5, 6.05, 5.4, 0);
  return grid;
}

TEST(ClosedWay, WhereAllWaysAreClosedTheyAreLookedAtInTurn) {
  // Two doors. The nearer is shut, and somebody stands in the farther, who leaves when the robot has gone back to the nearer.
  const OccupancyGrid map = rooms_with_two_doors(true), truth = rooms_with_two_doors(false);
  ToyWorld world(truth, map, {2.5, 2.4, 0.0}, {});
  const double began_s = world.now_s;
  world.discs.push_back({[=](double t) { return t - began_s < 30.0 ? Point2{6.0, 4.95} : Point2{-5.0, 0.0}; }});
  world.sees_free_from_m = 1.3;
  world.planner.set_goal({10.0, 1.0, 0.0});
  EXPECT_EQ(world.run(120.0).activity, Activity::kReached) << world.planner.failure().reason;
  EXPECT_EQ(world.collisions, 0);
}

TEST(ClosedWay, WhenEveryWaySeemsClosedTheNextOneIsLookedAtAfterTheNearest) {
  // Two doors. The nearer is shut. Before the farther somebody stood when the robot last saw it, and has left since.
  const OccupancyGrid map = rooms_with_two_doors(true), truth = rooms_with_two_doors(false);
  ToyWorld world(truth, map, {2.5, 3.4, 0.6}, {});
  const double began_s = world.now_s;
  world.discs.push_back({[=](double t) { return t - began_s < 2.5 ? Point2{5.7, 4.95} : Point2{-5.0, 0.0}; }});
  for (int i = 0; i < 40; ++i) world.step();
  world.sees_free_from_m = 1.3;
  world.planner.set_goal({10.0, 1.0, 0.0});
  EXPECT_EQ(world.run(120.0).activity, Activity::kReached) << world.planner.failure().reason;
  EXPECT_EQ(world.collisions, 0);
}

TEST(ClosedWay, TheRobotBacksUpFromSomebodyWithItsEyesOnHimUntilHeIsGone) {
  const OccupancyGrid grid = room(10.0, 1.2);
  ToyWorld world(grid, grid, {1.0, 0.6, 0.0});
  world.sees_free_from_m = 1.3;  // as a level Kinect does, which does not see the floor nearer than that
  const double comes_s = world.now_s + 5.0, leaves_s = comes_s + 4.0;
  Point2 stands{-5.0, 0.6};
  world.discs.push_back({[&](double t) {
    if (t < comes_s || t > leaves_s) return Point2{-5.0, 0.6};
    if (stands.x_m < 0.0) stands.x_m = world.T_map_base.x_m + 0.9;
    return stands;
  }});
  world.planner.set_goal({9.0, 0.6, 0.0});
  Command command;
  double turned_rad = 0.0;
  for (int i = 0; i < 1200 && !command.finished; ++i) {
    command = world.step();
    turned_rad = std::max(turned_rad, std::abs(world.T_map_base.yaw_rad));
  }
  EXPECT_EQ(command.activity, Activity::kReached) << world.planner.failure().reason;
  EXPECT_LT(turned_rad, 0.8);
  EXPECT_EQ(world.avoidances, 0);
  EXPECT_EQ(world.collisions, 0);
  EXPECT_LE(world.reversals, 2) << "back once, and on";
}

TEST(ClosedWay, BacksUpOnlyOverGroundItHasJustDriven) {
  // It was set down here.
  const OccupancyGrid grid = room(10.0, 1.2);
  ToyWorld world(grid, grid, {3.0, 0.6, 0.0});
  world.sees_free_from_m = 1.3;
  world.discs.push_back({[](double) { return Point2{3.9, 0.6}; }});
  world.planner.set_goal({9.0, 0.6, 0.0});
  for (int i = 0; i < 60; ++i) EXPECT_GE(world.step().v_mps, 0.0);
}

}  // namespace
}  // namespace knav
