// A way that is closed for now: from where the robot looks at it, and that it does not stay where it cannot see.
#include <gtest/gtest.h>

#include <cmath>

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

/// Two rooms with a door right before the robot and another one 14 m up the wall.
class TwoDoors : public ::testing::Test {
 protected:
  static OccupancyGrid rooms(double width_m) {
    OccupancyGrid grid = room(12.0, 20.0);
    fill(&grid, 5.95, 0.0, 6.05, 20.0, 100);
    fill(&grid, 5.95, 17.0, 6.05, 18.0, 0);
    if (width_m > 0.0) fill(&grid, 5.95, 3.0 - 0.5 * width_m, 6.05, 3.0 + 0.5 * width_m, 0);
    return grid;
  }
  TwoDoors() : map_(config_.preferred_radius_m() + 0.2, config_.clearance.occupied_threshold, config_.clearance.free_threshold), keeper_(config_) {
    map_.set_global({}, rooms(1.0), {});
    keeper_.set_map(map_);
    EXPECT_EQ(look(1.0, 0.0), PlanKeeper::Outcome::kToGoal);
    EXPECT_FALSE(goes_round());
  }
  /// The near door is seen open so far, at this time after the beginning.
  PlanKeeper::Outcome look(double width_m, double at_s, const std::vector<Point2>& moving = {}) {
    map_.set_local(rooms(width_m), Pose2{});
    return keeper_.replan(map_, {3.0, 3.0, 0.0}, {10.0, 3.0}, 100.0 + at_s, moving);
  }
  bool goes_round() const { return keeper_.path().remaining_m() > 20.0; }

  PlannerTrackerConfig config_;
  CombinedMap map_;
  PlanKeeper keeper_;
};

/// The robot sees the door from 0.9 m farther on, and need not hurry there.
constexpr double kToSee_s = 4.0;

TEST_F(TwoDoors, ADoorFoundShutIsGoneRoundAfterAMoment) {
  for (double t = 1.0; t < config_.planning.hold_s; t += 0.5) EXPECT_EQ(look(0.0, t), PlanKeeper::Outcome::kToBlockage) << t;
  look(0.0, config_.planning.hold_s + kToSee_s);
  EXPECT_TRUE(goes_round());
}

TEST_F(TwoDoors, ForSomebodyWhoWalksThereTheRobotWaitsAsLongAsTheWayRoundIsLong) {
  // 28 m longer at most: 0.15 x 28 m / 0.6 m/s = 7 s.
  const double worth_s = config_.planning.hold_share * 28.0 / config_.max_vel_x;
  ASSERT_GT(worth_s, config_.planning.hold_s + 2.0);
  EXPECT_EQ(look(0.0, 1.0, {{5.9, 3.2}}), PlanKeeper::Outcome::kToBlockage);
  EXPECT_EQ(look(0.0, config_.planning.hold_s + 1.5), PlanKeeper::Outcome::kToBlockage);
  look(0.0, worth_s + kToSee_s);
  EXPECT_TRUE(goes_round());
}

TEST_F(TwoDoors, WhoWalksElsewhereIsNotWaitedFor) {
  look(0.0, 1.0, {{2.0, 15.0}});
  look(0.0, config_.planning.hold_s + kToSee_s);
  EXPECT_TRUE(goes_round());
}

TEST_F(TwoDoors, AWayFoundShutMustBeWiderThanTheRobotToTurnBackFor) {
  look(0.0, 1.0);
  look(0.0, config_.planning.hold_s + kToSee_s);
  ASSERT_TRUE(goes_round());
  for (double t = 10.0; t < 20.0; t += 1.0) {
    look(0.5, t);  // hardly wider than the robot needs
    EXPECT_TRUE(goes_round()) << t;
    look(0.0, t + 0.5);
    EXPECT_TRUE(goes_round()) << t;
  }
  look(0.9, 20.0);
  EXPECT_FALSE(goes_round());
}

TEST_F(TwoDoors, AWayFoundShutThatHasGoneOffTheLocalMapIsNotTurnedBackForUntilItIsSeenOpen) {
  // On the long way round the local map loses the door, and the combined map has it open again, as the building's map has it.
  look(0.0, 1.0);
  look(0.0, config_.planning.hold_s + kToSee_s);
  ASSERT_TRUE(goes_round());
  OccupancyGrid unknown = rooms(1.0);
  std::fill(unknown.value.begin(), unknown.value.end(), static_cast<std::int8_t>(-1));
  for (double t = 12.0; t < 30.0; t += 1.0) {
    map_.set_local(unknown, Pose2{});
    ASSERT_EQ(map_.combined().at(map_.global().geometry.cell_x(6.0), map_.global().geometry.cell_y(3.0)), CellState::kFree);
    EXPECT_EQ(keeper_.replan(map_, {3.0, 3.0, 0.0}, {10.0, 3.0}, 100.0 + t), PlanKeeper::Outcome::kToGoal);
    EXPECT_TRUE(goes_round()) << t;
  }
  look(0.9, 31.0);
  EXPECT_FALSE(goes_round());
}

TEST_F(TwoDoors, ForAWayThatSomebodyClosedTheRobotTurnsBackOnceHeHasHadTimeToWalkOn) {
  look(0.0, 1.0, {{5.9, 3.2}});
  const double left_s = config_.planning.hold_share * 28.0 / config_.max_vel_x + kToSee_s;
  look(0.0, left_s);
  ASSERT_TRUE(goes_round());
  OccupancyGrid unknown = rooms(1.0);
  std::fill(unknown.value.begin(), unknown.value.end(), static_cast<std::int8_t>(-1));
  map_.set_local(unknown, Pose2{});
  const double until_s = left_s + config_.planning.somebody_memory_s;
  keeper_.replan(map_, {3.0, 3.0, 0.0}, {10.0, 3.0}, 100.0 + until_s - 1.0);
  EXPECT_TRUE(goes_round());
  keeper_.replan(map_, {3.0, 3.0, 0.0}, {10.0, 3.0}, 100.0 + until_s + 1.0);
  EXPECT_FALSE(goes_round());
}

TEST_F(TwoDoors, AWayFoundShutTwiceIsNotTurnedBackForThoughItLooksOpen) {
  // What leaves half a metre beside a wall looks open from 6 m and closed from 3 m: in Willow Garage the robot turned to and fro
  // before it until its time was over.
  double t = 0.0;
  for (int time = 0; time < 2; ++time) {
    EXPECT_FALSE(goes_round()) << time;
    look(0.0, t += 1.0);
    look(0.0, t += config_.planning.hold_s + kToSee_s);
    ASSERT_TRUE(goes_round()) << time;
    look(0.9, t += 10.0);
  }
  EXPECT_TRUE(goes_round());
  const double found_s = t - 10.0;
  look(0.9, found_s + config_.planning.closed_memory_s - 1.0);
  EXPECT_TRUE(goes_round());
  look(0.9, found_s + config_.planning.closed_memory_s + 1.0);
  EXPECT_FALSE(goes_round());
}

TEST(ClosedWay, AWayThatIsFarRoundIsNotTakenBeforeTheRobotHasBeenWhereItSees) {
  // 10 m before the door, which then seems shut; 32 m round.
  const PlannerTrackerConfig config;
  OccupancyGrid open = room(18.0, 20.0);
  fill(&open, 11.95, 0.0, 12.05, 20.0, 100);
  fill(&open, 11.95, 17.0, 12.05, 18.0, 0);
  OccupancyGrid shut = open;
  fill(&open, 11.95, 2.5, 12.05, 3.5, 0);
  CombinedMap map(config.preferred_radius_m() + 0.2, config.clearance.occupied_threshold, config.clearance.free_threshold);
  map.set_global({}, open, {});
  PlanKeeper keeper(config);
  keeper.set_map(map);
  ASSERT_EQ(keeper.replan(map, {2.0, 3.0, 0.0}, {16.0, 3.0}, 100.0), PlanKeeper::Outcome::kToGoal);
  map.set_local(shut, Pose2{});
  for (double t = 1.0; t < 10.0; t += 1.0) {  // at 0.6 m/s
    EXPECT_EQ(keeper.replan(map, {2.0 + 0.6 * t, 3.0, 0.0}, {16.0, 3.0}, 100.0 + t), PlanKeeper::Outcome::kToBlockage) << t;
  }
  // Near by it turns out to be a wide enough gap.
  map.set_local(open, Pose2{});
  EXPECT_EQ(keeper.replan(map, {9.0, 3.0, 0.0}, {16.0, 3.0}, 113.0), PlanKeeper::Outcome::kToGoal);
  EXPECT_LT(keeper.path().remaining_m(), 10.0);
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

TEST(ClosedWay, ALaneThatAWallsCellsNarrowStaysOpenForTheRobotOnItsWayThere) {
  // A wall across a room, aslant: with these gaps on either side of the straight way the nearest of its cells is 0.22 m off, and a
  // new way needs 0.25 m.
  const auto gap = [](double above_cells, double below_cells) {
    OccupancyGrid grid = room(8.0, 6.0);
    const GridGeometry& g = grid.geometry;
    for (const double side : {-1.0, 1.0}) {
      for (double t = side > 0.0 ? above_cells : below_cells; t < 80.0; t += 0.25) {
        const int ix = 80 + static_cast<int>(std::lround(side * t / std::sqrt(5.0)));
        const int iy = 60 + static_cast<int>(std::lround(side * 2.0 * t / std::sqrt(5.0)));
        for (const int y : {iy, iy + static_cast<int>(side)}) {
          if (g.contains(ix, y)) grid.value[g.index(ix, y)] = 100;
        }
      }
    }
    return grid;
  };
  const OccupancyGrid wide = gap(9.0, 9.0), narrow = gap(4.5, 5.25), closed = gap(3.5, 3.5);
  const PlannerTrackerConfig config;
  CombinedMap map(config.preferred_radius_m() + 0.2, config.clearance.occupied_threshold, config.clearance.free_threshold);
  map.set_global({}, wide, {});
  PlanKeeper keeper(config);
  keeper.set_map(map);
  const Pose2 robot{2.0, 4.0, 0.0};
  const Point2 goal{6.0, 2.0};
  ASSERT_EQ(keeper.replan(map, robot, goal, 100.0), PlanKeeper::Outcome::kToGoal);
  map.set_local(narrow, Pose2{});
  PlanResult anew;
  keeper.planner().plan(map.combined(), {2.0, 4.0}, goal, &anew);
  ASSERT_EQ(anew.code, PlanCode::kNoPath);
  EXPECT_EQ(keeper.replan(map, robot, goal, 101.0), PlanKeeper::Outcome::kToGoal);
  map.set_local(closed, Pose2{});
  EXPECT_EQ(keeper.replan(map, robot, goal, 102.0), PlanKeeper::Outcome::kToBlockage);
  // The tracker, which measures to what the scan meets, has the last word.
  map.set_local(wide, Pose2{});
  ASSERT_EQ(keeper.replan(map, robot, goal, 103.0), PlanKeeper::Outcome::kToGoal);
  map.set_local(narrow, Pose2{});
  keeper.too_narrow(104.0);
  EXPECT_EQ(keeper.replan(map, robot, goal, 104.0), PlanKeeper::Outcome::kToBlockage);
}

TEST_F(TwoDoors, WhereBothAreShutOneLookAtTheNearOneIsEnoughAndTwoIfThereIsNoOther) {
  const auto looked_at = [&](bool two_doors, int looks) {
    OccupancyGrid map = rooms(1.0), seen = rooms(0.0);
    fill(&seen, 5.95, 17.0, 6.05, 18.0, 100);
    if (!two_doors) fill(&map, 5.95, 17.0, 6.05, 18.0, 100);
    map_.set_global({}, map, {});
    map_.set_local(seen, Pose2{});
    PlanKeeper keeper(config_);
    keeper.set_map(map_);
    double at_s = 200.0;
    EXPECT_EQ(keeper.replan(map_, {3.0, 3.0, 0.0}, {10.0, 3.0}, at_s, {}), PlanKeeper::Outcome::kToBlockage);
    EXPECT_NEAR(keeper.at().y_m, 3.0, 0.3);
    for (int i = 0; i < looks; ++i) {
      keeper.look_elsewhere();
      EXPECT_EQ(keeper.replan(map_, {3.0, 3.0, 0.0}, {10.0, 3.0}, at_s += 6.0, {}), PlanKeeper::Outcome::kToBlockage);
    }
    return keeper.at().y_m;
  };
  EXPECT_NEAR(looked_at(true, 1), 17.5, 0.3);
  EXPECT_NEAR(looked_at(false, 1), 3.0, 0.3);
  EXPECT_NEAR(looked_at(false, 2), 3.0, 0.3);  // back to it: there is no other
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

TEST_F(TwoDoors, ANarrowWayThatWasNeverFoundShutIsTaken) {
  look(0.5, 1.0);
  EXPECT_FALSE(goes_round());
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

/// A corridor, and a way round it that is 10 m longer.
OccupancyGrid corridor_and_detour() {
  OccupancyGrid grid = room(14.0, 6.0);
  fill(&grid, 2.0, 1.3, 12.0, 4.7, 100);
  return grid;
}

TEST(ClosedWay, ARobotWhoseCorridorSomebodyCrossesWaitsAndDoesNotTurnRoundForTheWayRound) {
  const OccupancyGrid grid = corridor_and_detour();
  ToyWorld world(grid, grid, {2.5, 0.65, 0.0});
  const double began_s = world.now_s;
  // Stands in the corridor for 3 s, then leaves through the wall.
  world.discs.push_back({[=](double t) { return t - began_s > 2.0 && t - began_s < 5.0 ? Point2{7.0, 0.65} : Point2{-5.0, 0.0}; }});
  world.planner.set_goal({11.5, 0.65, 0.0});
  double turned_rad = 0.0;
  Command command;
  for (int i = 0; i < 1200 && !command.finished; ++i) {
    command = world.step();
    turned_rad = std::max(turned_rad, std::abs(world.T_map_base.yaw_rad));
  }
  EXPECT_EQ(command.activity, Activity::kReached);
  EXPECT_LT(turned_rad, 1.0) << "it turned round";
  EXPECT_LT(world.now_s - began_s, 27.0);
  EXPECT_EQ(world.collisions, 0);
}

TEST(ClosedWay, ARobotWhoseCorridorStaysClosedTakesTheWayRound) {
  const OccupancyGrid grid = corridor_and_detour();
  ToyWorld world(grid, grid, {2.5, 0.65, 0.0});
  world.discs.push_back({[](double) { return Point2{7.0, 0.65}; }});
  world.planner.set_goal({11.5, 0.65, 0.0});
  EXPECT_EQ(world.run(90.0).activity, Activity::kReached);
  EXPECT_GT(world.driven_m, 15.0);
  EXPECT_EQ(world.collisions, 0);
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
