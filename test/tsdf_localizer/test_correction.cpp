#include "tsdf_localizer/correction.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/grid_geometry.h"
#include "tsdf_localizer/map_fields.h"

namespace knav {
namespace {

// Far from odometry's origin, where a turn of map->odom alone moves the robot a long way.
const Pose2 kOdom{100.0, 50.0, 2.0}, kRobot{3.0, 4.0, 0.5};

Pose2 map_odom(const Pose2& T_map_base) { return T_map_base * kOdom.inverse(); }

TEST(Correction, IsMeasuredAtTheRobotAndRatedBySizeAndExpectation) {
  const auto rated = [](const Pose2& step, double sd_m) {
    return rate_correction(map_odom(kRobot), map_odom(kRobot * step), kOdom, sd_m, 0.0);
  };
  const Correction c = rated({0.03, 0.04, 0.01}, 0.0);
  EXPECT_NEAR(c.distance_m, 0.05, 1e-9);
  EXPECT_NEAR(c.turn_rad, 0.01, 1e-9);
  EXPECT_EQ(c.rating, Correction::Rating::kSmall);
  EXPECT_EQ(rated({0.2, 0.0, 0.0}, 0.01).rating, Correction::Rating::kNotable);
  EXPECT_EQ(rated({0.2, 0.0, 0.0}, 0.1).rating, Correction::Rating::kSmall) << "within three sd";
  EXPECT_EQ(rated({0.0, 0.0, 0.1}, 1.0).rating, Correction::Rating::kNotable);
  EXPECT_EQ(rated({0.0, 0.0, -0.5}, 1.0).rating, Correction::Rating::kJump);
  EXPECT_EQ(rated({2.0, 0.0, 0.0}, 5.0).rating, Correction::Rating::kJump);
}

TEST(CorrectionTally, KeepsTheLargest) {
  CorrectionTally tally;
  tally.add({0.3, 0.0, Correction::Rating::kSmall});
  tally.add({0.2, 0.0, Correction::Rating::kNotable});
  tally.add({0.1, 0.0, Correction::Rating::kSmall});
  EXPECT_EQ(tally.count[0], 2u);
  EXPECT_EQ(tally.count[1], 1u);
  EXPECT_NEAR(tally.largest.distance_m, 0.2, 1e-9);
}

TEST(SlewLimit, MovesTheRobotNoFasterThanAskedAndArrives) {
  SlewLimit limit;
  limit.speed_mps = 0.1;
  limit.turn_radps = 0.05;
  const Pose2 wanted = map_odom(kRobot * Pose2{0.3, -0.1, 0.08});
  Pose2 published = map_odom(kRobot);
  int steps = 0;
  for (; steps < 200 && distance_m(published * kOdom, wanted * kOdom) > 1e-9; ++steps) {
    const Pose2 before = published;
    published = slewed(published, wanted, kOdom, 0.1, limit);
    const Pose2 T = (before * kOdom).inverse() * (published * kOdom);
    ASSERT_LE(std::hypot(T.x_m, T.y_m), 0.01 + 1e-9);
    ASSERT_LE(std::fabs(T.yaw_rad), 0.005 + 1e-9);
  }
  EXPECT_EQ(steps, 32);  // 0.316 m at 0.01 m a step
}

TEST(SlewLimit, WithoutOneAndAfterAJumpTheEstimateIsTakenAtOnce) {
  const Pose2 near = map_odom(kRobot * Pose2{0.3, 0.0, 0.0}), far = map_odom(kRobot * Pose2{3.0, 0.0, 0.0});
  EXPECT_EQ(distance_m(slewed(map_odom(kRobot), near, kOdom, 0.1, SlewLimit()), near), 0.0);
  SlewLimit limit;
  limit.speed_mps = 0.1;
  EXPECT_EQ(distance_m(slewed(map_odom(kRobot), far, kOdom, 0.1, limit), far), 0.0);
}

TEST(ShowsTheSame, TellsTheOccupancyOfAMapFromThatOfAnother) {
  DistanceMap map;
  map.geometry.width_cells = 4;
  map.geometry.height_cells = 1;
  map.distance_m = {0.02f, -0.02f, 0.07f, 0.12f};
  OccupancyGrid grid{map.geometry, {0, 100, 0, 0}};
  EXPECT_TRUE(shows_the_same(map, grid));
  grid.value = {0, 0, 0, 100};
  EXPECT_FALSE(shows_the_same(map, grid)) << "a wall where there is none";
  grid.value = {0, 100, 0, 0};
  grid.geometry.origin_x_m = 1.0;
  EXPECT_FALSE(shows_the_same(map, grid));
  grid = {map.geometry, {0, 100, 0}};
  EXPECT_FALSE(shows_the_same(map, grid));
}

}  // namespace
}  // namespace knav
