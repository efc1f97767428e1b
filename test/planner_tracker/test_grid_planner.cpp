#include <gtest/gtest.h>

#include <cmath>

#include "planner_tracker/grid_planner.h"
#include "planner_tracker/theta_star.h"
#include "toy_world.h"

namespace knav {
namespace {

struct Fixture {
  explicit Fixture(const OccupancyGrid& grid, const OccupancyGrid& keepout = {},
                   const PlannerTrackerConfig& c = {})
      : config(c), map(c.preferred_radius_m() + 0.2, 65, 25), planner(c) {
    map.set_global({}, grid, keepout);
    planner.set_map(map.global());
  }
  PlanResult plan(const Point2& a, const Point2& b) {
    PlanResult result;
    planner.plan(map.combined(), a, b, &result);
    return result;
  }
  PlannerTrackerConfig config;
  CombinedMap map;
  GridPlanner planner;
};

/// Samples far finer than a cell: all over free cells, and no nearer to anything than the hard radius less a
/// cell.
void expect_safe(const MapLayer& layer, const std::vector<Point2>& path, double hard_m) {
  ASSERT_GE(path.size(), 1u);
  for (std::size_t i = 1; i < path.size(); ++i) {
    for (int k = 0; k <= 400; ++k) {
      const double t = k / 400.0;
      const double x = path[i - 1].x_m + t * (path[i].x_m - path[i - 1].x_m);
      const double y = path[i - 1].y_m + t * (path[i].y_m - path[i - 1].y_m);
      ASSERT_EQ(layer.at(layer.geometry.cell_x(x), layer.geometry.cell_y(y)), CellState::kFree);
      ASSERT_GE(layer.clearance_m(x, y), hard_m - layer.geometry.resolution_m);
    }
  }
}

TEST(GridPlanner, AcrossAnEmptyRoomItIsAStraightLine) {
  Fixture f(room(10.0, 8.0));
  const PlanResult plan = f.plan({1.0, 1.0}, {8.63, 6.21});
  ASSERT_EQ(plan.code, PlanCode::kOk);
  EXPECT_NEAR(plan.length_m, std::hypot(7.63, 5.21), 1e-6);
  EXPECT_EQ(plan.path.size(), 2u);
  EXPECT_EQ(plan.path.front().x_m, 1.0);
  EXPECT_EQ(plan.path.back().x_m, 8.63);
}

TEST(GridPlanner, RoundAWallItIsTheTautStringAtThePreferredClearance) {
  OccupancyGrid grid = room(10.0, 8.0);
  fill(&grid, 4.9, 0.0, 5.1, 5.0, 100);  // a wall from below up to y = 5
  Fixture f(grid);
  const PlanResult plan = f.plan({2.0, 2.0}, {8.0, 2.0});
  ASSERT_EQ(plan.code, PlanCode::kOk);
  expect_safe(f.map.combined(), plan.path, f.config.hard_radius_m());
  // By hand: a tangent to the circle of radius r round the corner (4.9, 5), its arc up to the top, 0.2 m
  // across, and the same down again. The heading turns from (direction to the corner) + asin(r / d) to 0, and
  // so does the arc.
  const auto taut = [](double r) {
    const double d = std::hypot(2.9, 3.0);
    return 2.0 * (std::sqrt(d * d - r * r) + r * (std::atan2(3.0, 2.9) + std::asin(r / d))) + 0.2;
  };
  EXPECT_GT(plan.length_m, taut(f.config.hard_radius_m()) * 0.99);
  EXPECT_LT(plan.length_m, taut(f.config.preferred_radius_m()) * 1.03);
}

TEST(GridPlanner, NeverThroughAWallOrUnknownAndNearTheShortestOnRandomGrids) {
  int reached = 0;
  double worst = 0.0, sum = 0.0;
  for (int seed = 0; seed < 12; ++seed) {
    RandomStream random(11, random_stream::kTest, static_cast<std::uint64_t>(seed), 0);
    OccupancyGrid grid = room(12.0, 9.0);
    for (int i = 0; i < 26; ++i) {
      const double x = random.uniform(0.5, 11.0), y = random.uniform(0.5, 8.0);
      const bool wide = random.uniform() < 0.5;
      fill(&grid, x, y, x + (wide ? random.uniform(0.2, 2.5) : 0.1),
           y + (wide ? 0.1 : random.uniform(0.2, 2.5)), random.uniform() < 0.3 ? -1 : 100);
    }
    Fixture f(grid);
    for (int pair = 0; pair < 8; ++pair) {
      const Point2 a{random.uniform(0.3, 11.7), random.uniform(0.3, 8.7)},
          b{random.uniform(0.3, 11.7), random.uniform(0.3, 8.7)};
      if (!f.planner.open(f.map.combined(), a) || !f.planner.open(f.map.combined(), b)) continue;
      const PlanResult plan = f.plan(a, b);
      const double reference = theta_star_length_m(f.map.combined(), f.config.hard_radius_m(), a, b);
      // The same answer to whether there is a way, from a planner written independently.
      ASSERT_EQ(plan.code == PlanCode::kOk, std::isfinite(reference)) << "seed " << seed << " pair " << pair;
      if (plan.code != PlanCode::kOk) continue;
      expect_safe(f.map.combined(), plan.path, f.config.hard_radius_m());
      // Preferring clearance makes it longer than the shortest, but not by much: than the shortest that leaves half a cell more
      // than the hard clearance, as a passage that is barely wide enough is gone round where that costs less.
      const double roomy = theta_star_length_m(f.map.combined(), f.config.hard_radius_m() + 0.025, a, b);
      if (!std::isfinite(roomy)) continue;
      ++reached;
      const double ratio = plan.length_m / roomy;
      sum += ratio;
      worst = std::max(worst, ratio);
    }
  }
  ASSERT_GT(reached, 30);
  EXPECT_LT(sum / reached, 1.04);
  EXPECT_LT(worst, 1.30);
}

TEST(GridPlanner, WithoutAPriceOnClearanceItIsWithin3PercentOfTheShortest) {
  PlannerTrackerConfig config;
  config.clearance.price = 0.0;
  double worst = 0.0;
  int reached = 0;
  for (int seed = 0; seed < 10; ++seed) {
    RandomStream random(12, random_stream::kTest, static_cast<std::uint64_t>(seed), 0);
    OccupancyGrid grid = room(12.0, 9.0);
    for (int i = 0; i < 16; ++i) {
      const double x = random.uniform(0.5, 11.0), y = random.uniform(0.5, 8.0);
      fill(&grid, x, y, x + random.uniform(0.1, 1.2), y + random.uniform(0.1, 1.2), 100);
    }
    Fixture f(grid, {}, config);
    for (int pair = 0; pair < 8; ++pair) {
      const Point2 a{random.uniform(0.3, 11.7), random.uniform(0.3, 8.7)},
          b{random.uniform(0.3, 11.7), random.uniform(0.3, 8.7)};
      const double reference = theta_star_length_m(f.map.combined(), f.config.hard_radius_m(), a, b);
      if (!std::isfinite(reference) || reference < 1.0) continue;
      ++reached;
      worst = std::max(worst, f.plan(a, b).length_m / reference);
    }
  }
  ASSERT_GT(reached, 25);
  EXPECT_LT(worst, 1.03);
}

TEST(GridPlanner, PrefersTheMiddleOfAWidePassageButTakesANarrowOneIfItMust) {
  OccupancyGrid grid = room(8.0, 4.0);
  fill(&grid, 3.9, 0.0, 4.1, 1.7, 100);
  fill(&grid, 3.9, 2.3, 4.1, 4.0, 100);  // a gap of 0.60 m: the robot needs 0.50, which is 0.45 in cells
  Fixture f(grid);
  const PlanResult plan = f.plan({1.0, 0.6}, {7.0, 3.4});
  ASSERT_EQ(plan.code, PlanCode::kOk);
  expect_safe(f.map.combined(), plan.path, f.config.hard_radius_m());
  fill(&grid, 3.9, 1.7, 4.1, 1.9, 100);  // 0.40 m
  Fixture narrow(grid);
  const PlanResult none = narrow.plan({1.0, 0.6}, {7.0, 3.4});
  EXPECT_EQ(none.code, PlanCode::kNoPath);
}

TEST(GridPlanner, AGapBetweenTheCoarseNodesIsFound) {
  // Every offset of a gap just one open cell wide.
  for (int shift = 0; shift < 4; ++shift) {
    OccupancyGrid grid = room(6.0, 4.0);
    const double low = 1.5 + 0.05 * shift;
    fill(&grid, 2.9, 0.0, 3.1, low, 100);
    fill(&grid, 2.9, low + 0.55, 3.1, 4.0, 100);
    Fixture f(grid);
    EXPECT_EQ(f.plan({1.0, 1.0}, {5.0, 3.0}).code, PlanCode::kOk) << shift;
  }
}

TEST(GridPlanner, UnreachableGoalsSayWhyAndWhere) {
  OccupancyGrid grid = room(8.0, 6.0);
  fill(&grid, 5.0, 2.0, 7.0, 2.1, 100);
  fill(&grid, 5.0, 3.9, 7.0, 4.0, 100);
  fill(&grid, 5.0, 2.0, 5.1, 4.0, 100);
  fill(&grid, 6.9, 2.0, 7.0, 4.0, 100);  // a closed box
  fill(&grid, 1.0, 4.0, 2.0, 5.0, -1);
  Fixture f(grid);
  EXPECT_EQ(f.plan({1.0, 1.0}, {6.0, 3.0}).code, PlanCode::kNoPath);
  const PlanResult wall = f.plan({1.0, 1.0}, {5.05, 3.0});
  EXPECT_EQ(wall.code, PlanCode::kGoalOccupied);
  EXPECT_NEAR(wall.at.x_m, 5.05, 0.06);
  const PlanResult beside = f.plan({1.0, 1.0}, {4.85, 3.0});
  EXPECT_EQ(beside.code, PlanCode::kGoalOccupied);
  EXPECT_NEAR(beside.at.x_m, 5.025, 0.03);
  EXPECT_EQ(f.plan({1.0, 1.0}, {1.5, 4.5}).code, PlanCode::kGoalUnknown);
  EXPECT_EQ(f.plan({1.0, 1.0}, {-3.0, 4.5}).code, PlanCode::kGoalUnknown);
}

TEST(GridPlanner, KeepoutIsNotCrossedThoughTheLocalMapSeesItFree) {
  OccupancyGrid grid = room(8.0, 4.0), keepout = grid;
  std::fill(keepout.value.begin(), keepout.value.end(), std::int8_t{0});
  fill(&keepout, 3.5, 0.0, 4.5, 4.0, 100);
  Fixture f(grid, keepout);
  OccupancyGrid local = room(8.0, 4.0);
  f.map.set_local(local, Pose2{});
  EXPECT_EQ(f.plan({1.0, 2.0}, {7.0, 2.0}).code, PlanCode::kNoPath);
}

TEST(GridPlanner, AStartTooNearToAWallMayLeaveButNotThroughIt) {
  OccupancyGrid grid = room(6.0, 4.0);
  fill(&grid, 3.0, 0.0, 3.1, 4.0, 100);
  Fixture f(grid);
  // 0.10 m from the wall's face, on its left.
  const PlanResult left = f.plan({2.9, 2.0}, {1.0, 2.0});
  ASSERT_EQ(left.code, PlanCode::kOk);
  EXPECT_LT(left.length_m, 2.2);
  EXPECT_EQ(f.plan({2.9, 2.0}, {5.0, 2.0}).code, PlanCode::kNoPath);
  // In the middle of much that is unknown there is no way out.
  fill(&grid, 0.5, 0.5, 2.5, 3.5, -1);
  Fixture unknown(grid);
  EXPECT_EQ(unknown.plan({1.5, 2.0}, {5.0, 2.0}).code, PlanCode::kStartBlocked);
}

}  // namespace
}  // namespace knav
