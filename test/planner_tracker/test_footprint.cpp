#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "planner_tracker/planner_tracker.h"
#include "toy_world.h"

namespace knav {
namespace {

using testing::HasSubstr;

constexpr const char* kLong = "[[0.45, 0.15], [-0.25, 0.15], [-0.25, -0.15], [0.45, -0.15]]";

std::string fault_of(const std::string& text) {
  std::string fault;
  Footprint::from_text(text, &fault);
  return fault;
}

TEST(Footprint, RadiiOfAPolygonAreThoseOfItsNearestSideAndFarthestCorner) {
  std::string fault;
  const Footprint f = Footprint::from_text(kLong, &fault);
  EXPECT_EQ(fault, "");
  EXPECT_NEAR(f.inscribed_m(), 0.15, 1e-12);
  EXPECT_NEAR(f.circumscribed_m(), std::hypot(0.45, 0.15), 1e-12);
  const std::vector<Point2>& outline = f.outline();
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Point2 &a = outline[i], &b = outline[(i + 1) % outline.size()];
    EXPECT_LE(std::hypot(a.x_m - b.x_m, a.y_m - b.y_m), 0.06 + 1e-12) << "a thin leg would fit between them";
  }
}

TEST(Footprint, WhatIsNoPolygonRoundTheRobotIsRefusedWithASentence) {
  EXPECT_THAT(fault_of("[[0.3, 0.2], [-0.3, 0.2]]"), HasSubstr("at least three corners"));
  EXPECT_THAT(fault_of("[[0.3, 0.2], [-0.3, 0.2], [-0.3]]"), HasSubstr("at least three corners"));
  EXPECT_THAT(fault_of("a square"), HasSubstr("at least three corners"));
  EXPECT_THAT(fault_of("[[0.3, 0.2], [0.1, 0.2], [0.1, -0.2], [0.3, -0.2]]"), HasSubstr("base_link"));
  EXPECT_THAT(fault_of("[[300, 200], [-300, 200], [-300, -200], [300, -200]]"), HasSubstr("metres"));
  PlannerTrackerConfig config;
  config.footprint = "[[1, 2]]";
  EXPECT_EQ(config.validate().size(), 1u);
}

/// The least distance of the footprint's outline to a wall of the toy world.
double outline_clearance_m(const ToyWorld& world, const OccupancyGrid& grid, const Footprint& footprint) {
  const GridGeometry& g = grid.geometry;
  double least = 1e9;
  for (const Point2& p : footprint.outline()) {
    const Point2 m = world.T_map_base * p;
    const int cx = g.cell_x(m.x_m), cy = g.cell_y(m.y_m), reach = 6;
    for (int y = cy - reach; y <= cy + reach; ++y) {
      for (int x = cx - reach; x <= cx + reach; ++x) {
        if (!g.contains(x, y) || grid.value[g.index(x, y)] < 50) continue;
        const double dx = std::max(0.0, std::abs(m.x_m - g.center_x_m(x)) - 0.5 * g.resolution_m);
        const double dy = std::max(0.0, std::abs(m.y_m - g.center_y_m(y)) - 0.5 * g.resolution_m);
        least = std::min(least, std::hypot(dx, dy));
      }
    }
  }
  return least;
}

TEST(Footprint, ALongRobotGoesThroughADoorAndRoundACornerWithoutItsCornersTouching) {
  // Two rooms joined by a corridor with a corner, 1.1 m wide: the robot's longest diagonal is 0.95 m.
  OccupancyGrid grid = room(9.0, 6.0);
  fill(&grid, 3.0, 0.0, 3.1, 6.0, 100);
  fill(&grid, 3.0, 2.0, 3.1, 3.1, 0);
  fill(&grid, 3.1, 3.1, 5.0, 6.0, 100);
  fill(&grid, 3.1, 0.0, 4.9, 2.0, 100);
  fill(&grid, 6.0, 0.0, 6.1, 5.0, 100);
  PlannerTrackerConfig config;
  config.footprint = kLong;
  config.robot_radius = 0.14;  // the toy world's own check is of a disc inside the footprint
  std::string fault;
  const Footprint footprint = Footprint::from_text(kLong, &fault);
  ToyWorld world(grid, grid, {1.0, 1.0, 1.5}, config);
  double least_m = 1e9;
  for (const Pose2& goal : {Pose2{5.5, 1.2, -1.57}, Pose2{1.2, 4.8, 0.5}}) {
    ASSERT_TRUE(world.planner.set_goal(goal));
    Command command;
    for (int i = 0; i < 2400 && !command.finished; ++i) {
      command = world.step();
      least_m = std::min(least_m, outline_clearance_m(world, grid, footprint));
    }
    ASSERT_EQ(command.activity, Activity::kReached) << world.planner.failure().reason << world.planner.explanation();
  }
  EXPECT_GT(least_m, 0.0) << "a corner of the footprint was in the wall";
}

TEST(Footprint, ItDoesNotTurnWhereACornerWouldHitTheWallAndItDoesWhereADiscFits) {
  // A dead end 0.7 m wide: in it the long robot cannot turn, a disc of the same inscribed radius can.
  OccupancyGrid grid = room(5.0, 3.0);
  fill(&grid, 0.0, 0.0, 5.0, 1.15, 100);
  fill(&grid, 0.0, 1.85, 5.0, 3.0, 100);
  fill(&grid, 0.1, 1.15, 4.9, 1.85, 0);
  for (const bool polygon : {false, true}) {
    PlannerTrackerConfig config;
    config.robot_radius = 0.15;
    if (polygon) config.footprint = kLong;
    std::string fault;
    const Footprint footprint = Footprint::from_text(kLong, &fault);
    ToyWorld world(grid, grid, {1.0, 1.5, 0.0}, config);
    ASSERT_TRUE(world.planner.set_goal({1.0, 1.5, kPi}));
    double least_m = 1e9;
    Command command;
    for (int i = 0; i < 400 && !command.finished; ++i) {
      command = world.step();
      least_m = std::min(least_m, outline_clearance_m(world, grid, footprint));
    }
    if (polygon) {
      EXPECT_NE(command.activity, Activity::kReached);
      EXPECT_GT(least_m, 0.0);
    } else {
      EXPECT_EQ(command.activity, Activity::kReached);
      EXPECT_EQ(least_m, 0.0) << "the long robot would have touched: this world does tell the two apart";
    }
  }
}

}  // namespace
}  // namespace knav
