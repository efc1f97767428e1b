// A way that is closed for now: how long the robot waits for it, when it goes round, and for what it turns back.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "planner_tracker/plan_keeper.h"
#include "planner_tracker/planner_tracker.h"
#include "toy_world.h"

namespace knav {
namespace {

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
  /// With this in view, both doors shut, the near one was looked at in vain: the keeper leads to the other.
  void look_at_the_other(PlanKeeper* keeper, const OccupancyGrid& shut) {
    keeper->set_map(map_);
    map_.set_local(shut, Pose2{});
    keeper->replan(map_, {3.0, 3.0, 0.0}, {10.0, 3.0}, 200.0);
    keeper->look_elsewhere();
    EXPECT_EQ(keeper->replan(map_, {3.0, 3.0, 0.0}, {10.0, 3.0}, 206.0), PlanKeeper::Outcome::kToBlockage);
    ASSERT_NEAR(keeper->at().y_m, 17.5, 0.3) << "or this tests nothing";
    ASSERT_GT(keeper->path().end().y_m, 15.0);
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

TEST_F(TwoDoors, ADoorFoundShutIsNotTurnedBackForBecauseTheOneAheadSeemsClosedFromAfar) {
  for (double t = 1.0; t < config_.planning.hold_s + kToSee_s; t += 0.5) look(0.0, t);
  ASSERT_TRUE(goes_round());
  // On its way round the robot sees the first as just wide enough, and something in the other.
  OccupancyGrid seen = rooms(0.5);
  fill(&seen, 5.95, 17.0, 6.05, 18.0, 100);
  map_.set_local(seen, Pose2{});
  const auto along = [&](double more_m) { return keeper_.path().point_at(keeper_.path().at_m() + more_m); };
  const Point2 on_its_way = along(7.0), farther = along(8.0), there = along(13.0);
  PlanResult back;
  keeper_.planner().plan(map_.combined(), on_its_way, {10.0, 3.0}, &back);
  ASSERT_EQ(back.code, PlanCode::kOk) << "or this tests nothing";
  EXPECT_EQ(keeper_.replan(map_, {on_its_way.x_m, on_its_way.y_m, 0.0}, {10.0, 3.0}, 120.0), PlanKeeper::Outcome::kToBlockage) << "goes to see it first";
  EXPECT_GT(keeper_.path().end().y_m, 12.0);
  EXPECT_EQ(keeper_.replan(map_, {farther.x_m, farther.y_m, 0.0}, {10.0, 3.0}, 122.0), PlanKeeper::Outcome::kToBlockage);
  for (double t = 124.0; t < 150.0; t += 0.5) keeper_.replan(map_, {there.x_m, there.y_m, 0.0}, {10.0, 3.0}, t);
  EXPECT_LT(keeper_.path().end().y_m, 12.0) << "both were seen, and the first is open now";
}

TEST_F(TwoDoors, ForSomebodyInTheDoorAheadTheRobotWaitsTenSecondsWhereTheWayBackWasFoundShut) {
  for (double t = 1.0; t < config_.planning.hold_s + kToSee_s; t += 0.5) look(0.0, t);
  ASSERT_TRUE(goes_round());
  OccupancyGrid seen = rooms(0.5);  // just wide enough, it seems
  fill(&seen, 5.95, 17.0, 6.05, 18.0, 100);
  map_.set_local(seen, Pose2{});
  const Point2 before_it = keeper_.path().point_at(keeper_.path().at_m() + 13.0);
  const std::vector<Point2> trail{{5.9, 17.4}};
  double waited_s = 0.0;
  while (waited_s < 60.0) {
    keeper_.replan(map_, {before_it.x_m, before_it.y_m, 0.0}, {10.0, 3.0}, 120.0 + waited_s, trail);
    if (keeper_.path().end().y_m < 12.0) break;
    waited_s += 0.5;
  }
  // The way back counts as 40 m: 0.15 x 40 m / 0.6 m/s = 10 s, and the few metres to where the robot sees the door.
  EXPECT_GE(waited_s, 10.0);
  EXPECT_LE(waited_s, 10.0 + kToSee_s);
}

TEST_F(TwoDoors, WhatIsLeftOfTheWayIsTheSameWhetherItIsSeenOpenOrClosed) {
  look(1.0, 0.5);
  const double left_m = keeper_.remaining_m();
  EXPECT_EQ(look(0.0, 1.0), PlanKeeper::Outcome::kToBlockage);
  EXPECT_LT(keeper_.path().remaining_m(), left_m - 3.0) << "it ends before the door now";
  EXPECT_NEAR(keeper_.remaining_m(), left_m, 0.01);
  EXPECT_EQ(look(1.0, 1.4), PlanKeeper::Outcome::kToGoal);
  EXPECT_NEAR(keeper_.remaining_m(), left_m, 0.01);
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

TEST_F(TwoDoors, OnItsWayToTheOtherShutOneTheRobotDoesNotTurnBackForALaneThatOpensForAMoment) {
  OccupancyGrid shut = rooms(0.0), lane = rooms(0.5);
  for (OccupancyGrid* seen : {&shut, &lane}) fill(seen, 5.95, 17.0, 6.05, 18.0, 100);
  PlanKeeper keeper(config_);
  look_at_the_other(&keeper, shut);
  double t = 206.0;
  const auto see = [&](const OccupancyGrid& seen, const Point2& from, double after_s) {
    map_.set_local(seen, Pose2{});
    return keeper.replan(map_, {from.x_m, from.y_m, 0.0}, {10.0, 3.0}, t += after_s);
  };
  const Path way = keeper.path();
  for (double along_m = 1.0; along_m < 6.0; along_m += 0.5) {
    for (const OccupancyGrid* seen : {&lane, &lane, &shut}) {
      EXPECT_EQ(see(*seen, way.point_at(along_m), 0.3), PlanKeeper::Outcome::kToBlockage) << along_m;
      EXPECT_NEAR(keeper.at().y_m, 17.5, 0.3) << along_m;
      EXPECT_GT(keeper.path().end().y_m, 15.0) << along_m;
    }
  }
  // Open for good, though hardly wider than the robot needs.
  see(lane, way.point_at(6.0), 0.3);
  EXPECT_EQ(see(lane, way.point_at(6.0), 2.5), PlanKeeper::Outcome::kToGoal);
  EXPECT_LT(keeper.path().end().y_m, 5.0);
}

TEST_F(TwoDoors, WhatClosesTheWayHalfAMetreFartherOnIsTheSameThing) {
  // From afar the door looks open, and shut behind it.
  OccupancyGrid shut = rooms(0.0), behind = rooms(1.0);
  fill(&behind, 6.3, 2.35, 6.4, 3.65, 100);
  fill(&behind, 6.0, 2.35, 6.4, 2.45, 100);
  fill(&behind, 6.0, 3.55, 6.4, 3.65, 100);
  for (OccupancyGrid* seen : {&shut, &behind}) fill(seen, 5.95, 17.0, 6.05, 18.0, 100);
  PlanKeeper keeper(config_);
  look_at_the_other(&keeper, shut);
  const Point2 on_its_way = keeper.path().point_at(6.0);
  map_.set_local(behind, Pose2{});
  EXPECT_EQ(keeper.replan(map_, {on_its_way.x_m, on_its_way.y_m, 0.0}, {10.0, 3.0}, 216.0), PlanKeeper::Outcome::kToBlockage);
  EXPECT_NEAR(keeper.at().y_m, 17.5, 0.3);
  EXPECT_GT(keeper.path().end().y_m, 15.0);
}

TEST_F(TwoDoors, OnItsWayToTheOtherShutOneTheRobotTurnsBackForADoorThatHasOpened) {
  OccupancyGrid shut = rooms(0.0), open = rooms(0.9);
  for (OccupancyGrid* seen : {&shut, &open}) fill(seen, 5.95, 17.0, 6.05, 18.0, 100);
  PlanKeeper keeper(config_);
  look_at_the_other(&keeper, shut);
  map_.set_local(open, Pose2{});
  EXPECT_EQ(keeper.replan(map_, {3.0, 4.0, 0.0}, {10.0, 3.0}, 208.0), PlanKeeper::Outcome::kToGoal);
}

TEST_F(TwoDoors, ANarrowWayThatWasNeverFoundShutIsTaken) {
  look(0.5, 1.0);
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

}  // namespace
}  // namespace knav
