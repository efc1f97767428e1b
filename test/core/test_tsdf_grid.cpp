// Hand-worked answers of equations 2-6.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "core/tsdf_grid.h"
#include "test/core/tsdf_observations.h"

namespace knav {
namespace {

TEST(TsdfGrid, ValuesAlongOneRayByHand) {
  // A wall 2 m ahead of a sensor in the middle of a cell at (0.025, 0.025), mu = 0.4 m, cells of 5 cm. The
  // cell whose centre is d ahead has F = (2 - d) / 0.4, weight 1 / max(d, 0.5)^2.
  const TsdfConfig config = fixed_truncation(0.4);
  TsdfGrid grid(config, 6.0);
  TsdfObservation o;
  observation_from(profile_of({2.0f, 2.0f, 2.0f}, 20.0), limits_of(config), &o);
  o.sequence = 1;
  o.T_map_sensor = {0.025, 0.025, 0.0};
  grid.add(o);
  const auto cell = [](double ahead_m) { return static_cast<int>(std::lround(ahead_m / 0.05)); };
  EXPECT_NEAR(grid.distance(cell(1.8), 0), 0.5, 1e-3);  // 0.2 m before the wall
  EXPECT_NEAR(grid.distance(cell(2.0), 0), 0.0, 1e-3);  // on it
  EXPECT_NEAR(grid.distance(cell(2.3), 0), -0.75,
              1e-3);                        // 0.3 m behind: negative (equation 2 misprints this)
  EXPECT_FALSE(grid.known(cell(2.45), 0));  // beyond the truncation: null
  EXPECT_FALSE(grid.known(cell(1.5), 0));   // in front, but nobody saw it free
  EXPECT_NEAR(grid.weight(cell(2.0), 0), 1.0 / 4.0, 1e-4);
  EXPECT_NEAR(grid.weight(cell(1.8), 0), 1.0 / 3.24, 1e-4);
  EXPECT_FALSE(grid.known(0, cell(2.0)));  // beside the view
}

TEST(TsdfGrid, RangeAlongTheRayNotDepth) {
  // Equation 3: at the edge column of a camera with fx = 1 px a depth of 2 m is a range of 2 sqrt(2) m. The
  // cell at that point of a 45 degree ray has F = 0, the cell at range 2 m is 0.83 m in front: outside the
  // truncation.
  const TsdfConfig config = fixed_truncation(0.4);
  TsdfGrid grid(config, 6.0);
  TsdfObservation o;
  observation_from(profile_of({2.0f, 2.0f, 2.0f}, 1.0), limits_of(config), &o);
  o.sequence = 1;
  o.T_map_sensor = {0.025, 0.025, 0.0};
  grid.add(o);
  EXPECT_NEAR(grid.distance(40, 40), 0.0, 1e-3);  // column 0 looks left: (2, 2) m
  EXPECT_NEAR(grid.distance(40, -40), 0.0, 1e-3);
  EXPECT_NEAR(grid.weight(40, 40), 1.0 / 8.0, 1e-4);
  EXPECT_FALSE(grid.known(28, 28));
}

TEST(TsdfGrid, TruncationGrowsWithRange) {
  TruncationConfig truncation{0.4, 0.003, 2.0, 0.2, 4};
  EXPECT_FLOAT_EQ(truncation.at(0.0f), 0.4f);
  EXPECT_FLOAT_EQ(truncation.at(10.0f), 0.7f);
  EXPECT_FLOAT_EQ(truncation.at(20.0f), 1.6f);
  EXPECT_FLOAT_EQ(truncation.at(30.0f), 2.0f);  // its limit
  truncation.scan_base_m = 0.5;
  EXPECT_FLOAT_EQ(truncation.at(10.0f, true), 0.8f) << "a scan's";
}

TEST(TsdfGrid, NoSpurStandsOutOfTheFarCornerOfAThing) {
  // A box's face 1 m ahead on the left, its edge before the middle; a wall at 3 m on the right. mu = 0.4 m.
  TsdfConfig config = fixed_truncation(0.4);
  config.truncation.edge_width_m = 0.15;
  config.truncation.edge_behind = 0.25;
  std::vector<float> z_m(601, 3.0f);
  std::fill(z_m.begin(), z_m.begin() + 300, 1.0f);
  TsdfObservation o;
  observation_from(profile_of(z_m, 585.0), limits_of(config), &o);
  // 0.15 m at 1 m are 88 columns; sine instead of tangent leaves one of them.
  EXPECT_TRUE(o.any_edge);
  EXPECT_EQ(o.behind_limit[299], -0.25f);
  EXPECT_EQ(o.behind_limit[299 - 85], -0.25f);
  EXPECT_EQ(o.behind_limit[299 - 92], -1.0f);
  EXPECT_EQ(o.behind_limit[300], -1.0f) << "beside the wall something is nearer: that is no edge of the wall";
  EXPECT_EQ(o.behind_limit[600], -1.0f);
  TsdfGrid grid(config, 6.0);
  o.sequence = 1;
  o.T_map_sensor = {0.025, 0.025, 0.0};
  grid.add(o);
  const auto known = [&](double ahead_m, double left_m) {
    return grid.known(grid.cell_of(0.025 + ahead_m), grid.cell_of(0.025 + left_m));
  };
  EXPECT_TRUE(known(1.05, 0.05)) << "5 cm behind the face";
  EXPECT_FALSE(known(1.2, 0.05)) << "20 cm behind it, near its edge";
  EXPECT_TRUE(known(1.2, 0.3)) << "20 cm behind it, 25 cm from its edge";
}

TEST(TsdfGrid, AveragesByWeight) {
  // Equations 5, 6 with hand-sized numbers: the same cell seen at F = 0.5 and F = 0 from 1.8 and 2.0 m away.
  const TsdfConfig config = fixed_truncation(0.4);
  TsdfGrid grid(config, 6.0);
  TsdfObservation o;
  observation_from(profile_of({2.0f, 2.0f, 2.0f}, 20.0), limits_of(config), &o);
  o.sequence = 1;
  o.T_map_sensor = {0.025, 0.025, 0.0};
  grid.add(o);  // cell 36 is 1.8 m ahead: F = 0.5
  o.sequence = 2;
  o.T_map_sensor = {-0.175, 0.025, 0.0};
  grid.add(o);  // now it is 2.0 m ahead: F = 0
  const double w1 = 1 / 3.24, w2 = 1 / 4.0;
  EXPECT_NEAR(grid.weight(36, 0), w1 + w2, 1e-4);
  EXPECT_NEAR(grid.distance(36, 0), 0.5 * w1 / (w1 + w2), 1e-3);
  o.sequence = 1;
  o.T_map_sensor = {0.025, 0.025, 0.0};
  grid.remove(o);  // equations 8, 9
  EXPECT_NEAR(grid.weight(36, 0), w2, 1e-4);
  EXPECT_NEAR(grid.distance(36, 0), 0.0, 1e-3);
}

TEST(TsdfGrid, FarRowsTakeTurns) {
  // A wall 6 m ahead, every row up to 1 m: of four frames each cell before 1 m gets all, one from there to 2 m two, one beyond 2 m
  // one. A frame weighs 1 / d^2 (at most 4).
  TsdfConfig config = fixed_truncation(0.4);
  config.every_row_to_m = 1.0;
  TsdfGrid grid(config, 8.0);
  DepthProfile profile = profile_of(std::vector<float>(41, 6.0f), 40.0);
  std::fill(profile.free_from_m.begin(), profile.free_from_m.end(), 0.3f);
  std::fill(profile.free_to_m.begin(), profile.free_to_m.end(), 6.0f);
  TsdfObservation o;
  observation_from(profile, limits_of(config), &o);
  o.T_map_sensor = {0.025, 0.025, 0.0};
  for (o.sequence = 1; o.sequence <= 4; ++o.sequence) grid.add(o);
  const auto frames = [&](int ix, int iy) {
    const double d2 = 0.0025 * (ix * ix + iy * iy);
    return grid.weight(ix, iy) * std::max(d2, 0.25);
  };
  for (int iy = -3; iy <= 3; ++iy) {
    EXPECT_NEAR(frames(10, iy), 4.0, 0.01) << iy;   // 0.5 m
    EXPECT_NEAR(frames(120, iy), 1.0, 0.01) << iy;  // 6 m: the wall
    EXPECT_NEAR(frames(60, iy), 1.0, 0.01) << iy;   // 3 m: free
    EXPECT_NEAR(frames(30, iy), 2.0, 0.01) << iy;   // 1.5 m: free
  }
  // A scan comes seldom and sees far: all of it, always.
  TsdfGrid scanned(config, 8.0);
  RangeScan scan;
  scan.angle_min_rad = -0.1;
  scan.angle_increment_rad = 0.01;
  scan.range_max_m = 20.0;
  scan.range_m.assign(21, 6.0f);
  observation_from(scan, limits_of(config), &o);
  o.sequence = 1;
  o.T_map_sensor = {0.025, 0.025, 0.0};
  scanned.add(o);
  for (int iy = -3; iy <= 3; ++iy) EXPECT_TRUE(scanned.known(100, iy)) << iy;
}

TEST(TsdfGrid, FreeOnlyWhereTheFloorWasSeen) {
  const TsdfConfig config = fixed_truncation(0.4);
  TsdfGrid grid(config, 6.0);
  DepthProfile profile = profile_of({4.0f, 4.0f, 4.0f}, 20.0);
  profile.free_from_m = {1.3f, 1.3f, 1.3f};
  profile.free_to_m = {3.0f, 3.0f, 3.0f};
  TsdfObservation o;
  observation_from(profile, limits_of(config), &o);
  o.sequence = 1;
  o.T_map_sensor = {0.025, 0.025, 0.0};
  grid.add(o);
  EXPECT_FALSE(grid.known(20, 0));  // 1 m ahead: the blind zone of a level camera
  EXPECT_FLOAT_EQ(grid.distance(40, 0), 1.0f);
  EXPECT_FALSE(grid.known(66, 0));  // 3.3 m: floor not seen, wall not near
  EXPECT_NEAR(grid.distance(76, 0), 0.5, 1e-3);
}

TEST(TsdfGrid, AScanCarvesTheWholeRayAndNothingWhereItIsUnknown) {
  const TsdfConfig config = fixed_truncation(0.4);
  TsdfGrid grid(config, 12.0);
  RangeScan scan;
  scan.angle_min_rad = -kPi;
  scan.angle_increment_rad = kPi / 180;
  scan.range_max_m = 30.0;
  scan.range_m.assign(360, 3.0f);
  for (int i = 255; i < 285; ++i) scan.range_m[static_cast<std::size_t>(i)] = kNaN;  // round +90 degrees
  TsdfObservation o;
  observation_from(scan, limits_of(config), &o);
  o.sequence = 1;
  o.T_map_sensor = {0.025, 0.025, 0.0};
  grid.add(o);
  EXPECT_FLOAT_EQ(grid.distance(0, 0), 1.0f);
  EXPECT_FLOAT_EQ(grid.distance(20, 0), 1.0f);
  EXPECT_FLOAT_EQ(grid.distance(-20, 0), 1.0f);
  EXPECT_FLOAT_EQ(grid.distance(0, -20), 1.0f);
  EXPECT_NEAR(grid.distance(-60, 0), 0.0, 2e-3);  // the seam of the angle
  EXPECT_FALSE(grid.known(0, 20));
  EXPECT_FALSE(grid.known(0, 60));
}

TEST(TsdfGrid, UnknownEntersNoInterpolation) {
  const TsdfConfig config = fixed_truncation(0.4);
  TsdfGrid grid(config, 6.0);
  TsdfObservation o;
  observation_from(profile_of({2.0f}, 20.0), limits_of(config), &o);  // one column: one row of cells
  o.sequence = 1;
  o.T_map_sensor = {0.025, 0.025, 0.0};
  grid.add(o);
  float value = -9.0f;
  // Half way between the known row 0 and a row never seen, F is the known row's.
  const int far_row = grid.known(36, 1) ? 2 : 1;
  ASSERT_FALSE(grid.known(36, far_row));
  EXPECT_NEAR(interpolate(grid, grid.center_m(36), grid.center_m(far_row - 1) + 0.025, &value), 0.5f, 1e-4);
  EXPECT_NEAR(value, 0.5f, 0.01f);
  value = -9.0f;
  EXPECT_EQ(interpolate(grid, -1.0, 0.0, &value), 0.0f);
  EXPECT_EQ(value, -9.0f);
}

TEST(TsdfGrid, SumsHoldAsManyFramesAsPromised) {
  // 3,600 frames at the nearest distance fit the 32-bit sums with a factor of 2.3 to spare.
  EXPECT_NEAR(TsdfConfig{}.observation_capacity() / 3600.0, 2.28, 0.01);
}

TEST(TsdfGrid, BadProfilesChangeNothing) {
  const TsdfConfig config = fixed_truncation(0.4);
  TsdfGrid grid(config, 6.0);
  const float inf = std::numeric_limits<float>::infinity();
  DepthProfile profile = profile_of({kNaN, inf, -1.0f, 0.0f, 1e30f}, 20.0);
  profile.free_from_m = {kNaN, inf, -1.0f, 2.0f, kNaN};
  profile.free_to_m = {kNaN, inf, 3.0f, 1.0f, 3.0f};
  TsdfObservation o;
  observation_from(profile, limits_of(config), &o);
  o.sequence = 1;
  grid.add(o);
  for (int iy = -100; iy < 100; ++iy) {
    for (int ix = -100; ix < 100; ++ix) ASSERT_FALSE(grid.known(ix, iy));
  }
}

}  // namespace
}  // namespace knav
