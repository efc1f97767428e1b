// Hand-worked answers of equations 2-6, and the property that makes the sliding window trustworthy: whatever
// is added, removed, scrolled and contradicted, a cell holds exactly the sum of what the rules say, to the
// bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "core/random.h"
#include "core/tsdf_grid.h"

namespace knav {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

TsdfConfig fixed_truncation(double mu_m) {
  TsdfConfig config;
  config.truncation = {mu_m, 0.0, mu_m, 0.0, 0, 0.0, 1.0};  // the paper's
  return config;
}

ObservationLimits limits_of(const TsdfConfig& config) {
  ObservationLimits limits;
  limits.truncation = config.truncation;
  limits.clear_margin_m = config.clear_margin_m;
  return limits;
}

/// A camera of `columns` columns whose middle one looks straight ahead.
DepthProfile profile_of(std::vector<float> z_m, double fx_px) {
  DepthProfile profile;
  const std::size_t n = z_m.size();
  profile.fx_px = fx_px;
  profile.cx_px = static_cast<double>(n - 1) / 2.0;
  profile.z_m = std::move(z_m);
  profile.free_from_m.assign(n, kNaN);
  profile.free_to_m.assign(n, kNaN);
  profile.height_class.assign(n, HeightClass::kMiddle);
  return profile;
}

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

TEST(TsdfGrid, ContradictedSurfaceIsGoneAtOnceAndAWallBesideItStays) {
  // A post stood 2 m ahead for 200 frames before a wall at 4 m. When it has gone, four frames clear it; the
  // wall that rays pass at a grazing angle is never contradicted.
  const TsdfConfig config = fixed_truncation(0.3);
  TsdfGrid grid(config, 12.0);
  RangeScan scan;
  scan.angle_min_rad = -0.5;
  scan.angle_increment_rad = 0.01;
  scan.range_max_m = 30.0;
  scan.range_m.assign(101, 4.0f);
  const auto add = [&](std::uint32_t sequence) {
    TsdfObservation o;
    observation_from(scan, limits_of(config), &o);
    o.sequence = sequence;
    o.T_map_sensor = {0.025, 0.025, 0.0};
    grid.add(o);
  };
  std::uint32_t sequence = 0;
  for (int i = 45; i <= 55; ++i) scan.range_m[static_cast<std::size_t>(i)] = 2.0f;
  for (int k = 0; k < 200; ++k) add(++sequence);
  EXPECT_LT(grid.distance(43, 0), 0.0f);
  const float wall = grid.distance(80, -20);
  scan.range_m.assign(101, 4.0f);
  for (int k = 0; k < 4; ++k) add(++sequence);
  EXPECT_FLOAT_EQ(grid.distance(40, 0), 1.0f);
  EXPECT_FLOAT_EQ(grid.distance(43, 0), 1.0f);
  EXPECT_GT(grid.cells_reset_by_contradiction(), 0u);
  EXPECT_EQ(grid.reset_sequence(80, -20), 0u);
  EXPECT_NEAR(grid.distance(80, -20), wall, 1e-3);
}

/// Ten columns' width of camera that sees a thing 0.9 m ahead, then only the wall at 3 m behind; the floor from 1.3 m on.
class BlindZone : public ::testing::Test {
 protected:
  void add(float z_m, HeightClass height, int frames, double sensor_x_m = 0.025) {
    for (int k = 0; k < frames; ++k) {
      DepthProfile profile = profile_of(std::vector<float>(101, z_m), 100.0);
      profile.height_class.assign(101, height);
      if (z_m > 1.3f) {
        profile.free_from_m.assign(101, 1.3f);
        profile.free_to_m.assign(101, z_m - 0.1f);
      }
      TsdfObservation o;
      observation_from(profile, limits_of(config_), &o);
      o.sequence = ++sequence_;
      o.T_map_sensor = {sensor_x_m, 0.025, 0.0};
      grid_.add(o);
      held_.push_back(o);
    }
  }
  TsdfConfig config_ = fixed_truncation(0.3);
  TsdfGrid grid_{config_, 6.0};
  std::uint32_t sequence_ = 0;
  std::vector<TsdfObservation> held_;
};

TEST_F(BlindZone, APersonWhoLeftIsGoneAfterFourFrames) {
  add(0.9f, HeightClass::kMiddle, 1800);  // a minute; cell 18 is 0.9 m ahead
  ASSERT_TRUE(grid_.known(18, 0));
  ASSERT_LT(grid_.distance(20, 0), 0.0f);
  add(3.0f, HeightClass::kMiddle, 3);
  EXPECT_TRUE(grid_.known(20, 0));  // three frames may be a glitch
  add(3.0f, HeightClass::kMiddle, 1);
  EXPECT_FALSE(grid_.known(18, 0));  // nearer than the floor is seen: not free, but no surface either
  EXPECT_FALSE(grid_.known(20, 0));
  // And it stays gone when the minute leaves the window: what was reset is not taken away twice.
  for (const TsdfObservation& o : held_) grid_.remove(o);
  EXPECT_FALSE(grid_.known(18, 0));
  EXPECT_EQ(grid_.weight_units(20, 0), 0);
  EXPECT_EQ(grid_.standing_weight_units(20, 0), 0);
}

TEST_F(BlindZone, ALowThingThatIsSeenNowAndThenFromAfarStandsWhereItIsSeenFromNear) {
  // 4 m off every other ray misses it, and calls its place free; from 2.4 m on all meet it, at 1.475 m. Ten times that weight would be
  // needed for its face to come to the fore by averages alone.
  for (int k = 0; k < 100; ++k) {
    add(5.0f, HeightClass::kMiddle, 1, -2.525);
    add(4.0f, HeightClass::kLow, 1, -2.525);
  }
  ASSERT_GT(grid_.distance(30, 0), 0.2f);
  add(2.4f, HeightClass::kLow, 60, -0.925);
  EXPECT_NEAR(grid_.distance(29, 0), 0.0, 0.03);
  EXPECT_NEAR(grid_.distance(30, 0), -0.17, 0.03);
  for (const TsdfObservation& o : held_) grid_.remove(o);
  EXPECT_EQ(grid_.weight_units(29, 0), 0);
  EXPECT_EQ(grid_.weight_units(30, 0), 0);
}

TEST_F(BlindZone, ALowThingsFrontStaysWhereItWasSeenWhenTheViewCutsItOff) {
  // Its front lies 1.4 m ahead of where it is first seen from; from 0.5 m farther on its front has left the view, and what is left
  // in it begins 15 cm behind the front.
  for (const double cut_front : {TruncationConfig{}.cut_front, 1.0}) {
    config_.truncation.cut_front = cut_front;
    grid_ = TsdfGrid(config_, 6.0);
    held_.clear();
    add(1.4f, HeightClass::kLow, 30, 0.025);
    ASSERT_NEAR(grid_.distance(28, 0), 0.0, 0.01);  // 1.425 m
    add(1.05f, HeightClass::kLow, 60, 0.525);       // at 1.575 m: its cell is number 31
    const bool stays = grid_.distance(28, 0) < 0.05 && grid_.distance(29, 0) < 0.0f;
    EXPECT_EQ(stays, cut_front < 1.0) << "the front stays by `cut_front` alone; F there is " << grid_.distance(28, 0);
    // Seen so for the first time it has a front, too: one cell that is freer than what it saw.
    add(1.03f, HeightClass::kLow, 4, 1.525);  // at 2.555 m
    EXPECT_GT(grid_.distance(50, 0), 0.0f);
    EXPECT_LT(grid_.distance(51, 0), 0.0f);
    EXPECT_EQ(grid_.known(49, 0), cut_front == 1.0);
    for (const TsdfObservation& o : held_) grid_.remove(o);
    EXPECT_EQ(grid_.weight_units(28, 0), 0);
    EXPECT_EQ(grid_.weight_units(50, 0), 0);
  }
}

TEST_F(BlindZone, WhoStepsCloseIsInTheMapBeforeTheCameraLosesHim) {
  // Half a minute of free space, seen from 1.5 m back, holds 900 frames against the few in which somebody comes up.
  for (const double appear_range_m : {TsdfConfig{}.appear_range_m, 0.0}) {
    config_.appear_range_m = appear_range_m;
    grid_ = TsdfGrid(config_, 6.0);
    add(4.5f, HeightClass::kMiddle, 900, -1.475);
    ASSERT_FLOAT_EQ(grid_.distance(20, 0), 1.0f);
    add(0.9f, HeightClass::kMiddle, 3);
    EXPECT_GT(grid_.distance(18, 0), 0.9f);  // three frames may be a glitch
    add(0.9f, HeightClass::kMiddle, 3);
    add(std::numeric_limits<float>::quiet_NaN(), HeightClass::kNone, 300);  // nearer than 0.5 m: no readings
    if (appear_range_m > 0.0) {
      EXPECT_NEAR(grid_.distance(17, 0), 0.05 / 0.3, 1e-3);  // cell 17 is 0.85 m ahead of the sensor
      EXPECT_NEAR(grid_.distance(19, 0), -0.05 / 0.3, 1e-3);
    } else {
      EXPECT_GT(grid_.distance(19, 0), 0.9f);
    }
  }
}

TEST_F(BlindZone, ALowThingIsInTheMapThoughItsPlaceWasCalledFreeFromAfar) {
  // From 3.5 m and more a thing of 5 cm is lost in the noise of the floor, so its place was seen as free for long.
  for (const HeightClass height : {HeightClass::kLow, HeightClass::kMiddle}) {
    grid_ = TsdfGrid(config_, 6.0);
    add(5.5f, HeightClass::kMiddle, 300, -2.475);
    ASSERT_FLOAT_EQ(grid_.distance(41, 0), 1.0f);
    add(2.0f, height, 3);
    EXPECT_GT(grid_.distance(41, 0), 0.9f);  // three frames may be a glitch
    add(2.0f, height, 3);
    // Cell 41 lies 5 cm behind the surface. A thing of middle height would have been seen from afar: it has to outweigh.
    if (height == HeightClass::kLow) {
      EXPECT_NEAR(grid_.distance(41, 0), -0.05 / 0.3, 1e-3);
      add(2.0f, height, 100);
      add(5.5f, HeightClass::kMiddle, 300, -2.475);  // back, from where it is not seen
      EXPECT_LT(grid_.distance(41, 0), 0.6f);
    } else {
      EXPECT_GT(grid_.distance(41, 0), 0.8f);
    }
  }
}

TEST_F(BlindZone, ALowOrAHighThingStays) {
  for (const HeightClass height : {HeightClass::kLow, HeightClass::kHigh}) {
    grid_.clear();
    add(0.9f, height, 10);
    const float before = grid_.distance(20, 0);
    ASSERT_LT(before, 0.0f);
    add(3.0f, HeightClass::kMiddle, 300);
    EXPECT_FLOAT_EQ(grid_.distance(20, 0), before);
  }
}

TEST_F(BlindZone, SomebodyBeforeALowThingDoesNotTakeItWithHim) {
  add(2.0f, HeightClass::kLow, 30);
  add(1.95f, HeightClass::kMiddle, 600);  // right at it for 20 s: the box is a 20th of the cell's weight
  ASSERT_LT(4 * grid_.standing_weight_units(41, 0), grid_.weight_units(41, 0));
  add(3.0f, HeightClass::kMiddle, 30, 1.0);  // from 1 m off, where it is out of view, after he has left
  EXPECT_LT(grid_.distance(41, 0), 0.1f);
  add(3.0f, HeightClass::kMiddle, 4, 0.4);  // from 1.6 m off, where the floor is seen: the box has gone as well
  EXPECT_FLOAT_EQ(grid_.distance(41, 0), 1.0f);
}

TEST_F(BlindZone, AMiddleThingNearerThanAnyViewStays) {
  add(0.55f, HeightClass::kMiddle, 10);  // middle_clear_from_m = 0.6: cell 11 is 0.55 m ahead
  const float before = grid_.distance(11, 0);
  add(3.0f, HeightClass::kMiddle, 300);
  EXPECT_FLOAT_EQ(grid_.distance(11, 0), before);
}

TEST_F(BlindZone, WhoStoodCloseBeforeAWallIsGoneToo) {
  // 0.25 m before the wall at 2 m, within its truncation of 0.3 m: never carved, but F there is 0.25 / 0.3 = 0.83 where
  // the person's was 0.
  add(1.75f, HeightClass::kMiddle, 1800);
  ASSERT_LT(grid_.distance(37, 0), 0.0f);  // 1.85 m
  add(2.0f, HeightClass::kMiddle, 4);
  EXPECT_NEAR(grid_.distance(35, 0), 0.25 / 0.3, 0.02);  // 1.75 m, only the new frames
}

TEST(TsdfGrid, PlainAndVectorCodeGiveTheSameBytes) {
  TsdfConfig config;  // the defaults: weights that fall off behind surfaces
  TsdfGrid plain(config, 3.2, false), vectors(config, 3.2, true);
  RandomStream random(11, random_stream::kTest, 3, 0);
  std::vector<TsdfObservation> held;
  double x = 0.0, y = 0.0;
  for (std::uint32_t sequence = 1; sequence <= 600; ++sequence) {
    x = std::fmod(x + random.uniform(-0.15, 0.2), 4.0);
    y = std::fmod(y + random.uniform(-0.15, 0.2), 4.0);
    const bool wild = random.uniform() < 0.3;
    const double wall_m = random.uniform(0.5, 5.0);
    DepthProfile profile = profile_of(std::vector<float>(57), 45.0);
    for (std::size_t i = 0; i < 57; ++i) {
      profile.z_m[i] = random.uniform() < 0.05 ? kNaN : static_cast<float>(wild ? random.uniform(0.3, 5.0) : wall_m);
      profile.free_from_m[i] = random.uniform() < 0.1 ? kNaN : 0.8f;
      profile.free_to_m[i] = static_cast<float>(wall_m);
      profile.height_class[i] = random.uniform() < 0.2 ? HeightClass::kLow : HeightClass::kMiddle;
    }
    TsdfObservation o;
    observation_from(profile, limits_of(config), &o);
    o.sequence = sequence;
    o.T_map_sensor = {x, y, random.uniform(-kPi, kPi)};
    for (TsdfGrid* grid : {&plain, &vectors}) {
      grid->scroll_to(x, y, sequence);
      grid->add(o);
    }
    held.push_back(o);
    if (held.size() > 20) {
      const auto victim = held.begin() + static_cast<std::ptrdiff_t>(random.uniform() * 20);
      for (TsdfGrid* grid : {&plain, &vectors}) grid->remove(*victim);
      held.erase(victim);
    }
  }
  EXPECT_GT(plain.cells_reset_by_contradiction(), 100u);
  EXPECT_EQ(plain.cells_reset_by_contradiction(), vectors.cells_reset_by_contradiction());
  int different = 0, standing = 0;
  for (int iy = plain.first_y(); iy < plain.first_y() + plain.size_cells() - 1; ++iy) {
    for (int ix = plain.first_x(); ix < plain.first_x() + plain.size_cells() - 1; ++ix) {
      different += plain.weighted_sum_units(ix, iy) != vectors.weighted_sum_units(ix, iy) ||
                           plain.weight_units(ix, iy) != vectors.weight_units(ix, iy) ||
                           plain.standing_weight_units(ix, iy) != vectors.standing_weight_units(ix, iy) ||
                           plain.reset_sequence(ix, iy) != vectors.reset_sequence(ix, iy) ||
                           plain.last_seen_s(ix, iy) != vectors.last_seen_s(ix, iy) ||
                           plain.value(ix, iy) != vectors.value(ix, iy) ||
                           plain.quads()[plain.quad_index(ix, iy)] != vectors.quads()[vectors.quad_index(ix, iy)]
                       ? 1
                       : 0;
      standing += plain.standing_weight_units(ix, iy) > 0 ? 1 : 0;
      // The quad is its four cells.
      const std::uint32_t quad = plain.quads()[plain.quad_index(ix, iy)];
      ASSERT_EQ(static_cast<std::int8_t>(quad & 255u), plain.value(ix, iy));
      ASSERT_EQ(static_cast<std::int8_t>(quad >> 8 & 255u), plain.value(ix + 1, iy));
      ASSERT_EQ(static_cast<std::int8_t>(quad >> 16 & 255u), plain.value(ix, iy + 1));
      ASSERT_EQ(static_cast<std::int8_t>(quad >> 24), plain.value(ix + 1, iy + 1));
    }
  }
  EXPECT_EQ(different, 0);
  EXPECT_GT(standing, 0);
  for (const TsdfObservation& o : held) plain.remove(o);
  for (int iy = plain.first_y(); iy < plain.first_y() + plain.size_cells(); ++iy) {
    for (int ix = plain.first_x(); ix < plain.first_x() + plain.size_cells(); ++ix) {
      ASSERT_EQ(plain.weight_units(ix, iy), 0);
      ASSERT_EQ(plain.standing_weight_units(ix, iy), 0);
    }
  }
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

/// What the rules say of one cell, kept beside the grid: all held observations not older than its reset.
void expect_equals_fresh_sum(const TsdfGrid& grid, const TsdfConfig& config,
                             const std::map<std::uint32_t, TsdfObservation>& held) {
  // A grid of its own for each observation gives that observation's part of every cell.
  const int n = grid.size_cells();
  std::vector<std::int32_t> sum(static_cast<std::size_t>(n) * static_cast<std::size_t>(n)),
      weight(sum.size());
  TsdfConfig no_reset = config;
  TsdfGrid single(no_reset, 0.5 * n * config.resolution_m);
  for (const auto& [sequence, observation] : held) {
    single.clear();
    single.scroll_to(grid.center_m(grid.first_x() + n / 2), grid.center_m(grid.first_y() + n / 2), 1);
    single.add(observation);
    for (int y = 0; y < n; ++y) {
      for (int x = 0; x < n; ++x) {
        const int ix = grid.first_x() + x, iy = grid.first_y() + y;
        if (!single.contains(ix, iy) || grid.reset_sequence(ix, iy) > sequence) continue;
        const auto i = static_cast<std::size_t>(y * n + x);
        sum[i] += single.weighted_sum_units(ix, iy);
        weight[i] += single.weight_units(ix, iy);
      }
    }
  }
  int wrong = 0, known = 0;
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      const int ix = grid.first_x() + x, iy = grid.first_y() + y;
      if (!single.contains(ix, iy)) continue;
      const auto i = static_cast<std::size_t>(y * n + x);
      wrong += grid.weighted_sum_units(ix, iy) != sum[i] || grid.weight_units(ix, iy) != weight[i] ? 1 : 0;
      known += weight[i] > 0 ? 1 : 0;
    }
  }
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(known, 0);
}

/// Sensor is a profile (or a scan), vector code is used.
class AddRemoveProperty : public ::testing::TestWithParam<std::tuple<bool, bool>> {};

TEST_P(AddRemoveProperty, ExactWhateverTheOrderWithScrollingAndResets) {
  const bool pinhole = std::get<0>(GetParam());
  const TsdfConfig config = fixed_truncation(0.3);
  TsdfGrid grid(config, 3.2, std::get<1>(GetParam()));  // 128 x 128 cells: the observations reach out of it
  std::map<std::uint32_t, TsdfObservation> held;
  RandomStream random(7, random_stream::kTest, pinhole ? 1 : 2, 0);
  std::uint32_t sequence = 0;
  double x = 0.0, y = 0.0;
  for (int round = 0; round < 1500; ++round) {
    x = std::fmod(x + random.uniform(-0.15, 0.2), 4.0);
    y = std::fmod(y + random.uniform(-0.15, 0.2), 4.0);
    grid.scroll_to(x, y, sequence + 1);
    TsdfObservation o;
    if (pinhole) {
      DepthProfile profile = profile_of(std::vector<float>(48), 45.0);
      const bool wild = random.uniform() < 0.5;
      const double wall_m = random.uniform(0.5, 5.0);
      for (std::size_t i = 0; i < 48; ++i) {
        profile.z_m[i] = wild && random.uniform() < 0.1
                             ? kNaN
                             : static_cast<float>(wild ? random.uniform(0.05, 5.0) : wall_m);
        profile.free_from_m[i] = 0.5f;
        profile.free_to_m[i] = static_cast<float>(wild ? random.uniform(0.3, 5.0) : wall_m);
      }
      observation_from(profile, limits_of(config), &o);
    } else {
      RangeScan scan;
      scan.angle_min_rad = random.uniform(-3.0, 0.0);
      scan.angle_increment_rad = 0.05;
      scan.range_max_m = 6.0;
      for (int i = 0; i < 70; ++i) scan.range_m.push_back(static_cast<float>(random.uniform(0.05, 5.0)));
      observation_from(scan, limits_of(config), &o);
    }
    o.sequence = ++sequence;
    o.T_map_sensor = {x + random.uniform(-0.5, 0.5), y, random.uniform(-kPi, kPi)};
    grid.add(o);
    held[o.sequence] = o;
    while (held.size() > 12 || (held.size() > 1 && random.uniform() < 0.2)) {
      auto victim = held.begin();
      std::advance(victim, static_cast<std::ptrdiff_t>(random.uniform() * static_cast<double>(held.size())));
      grid.remove(victim->second);
      held.erase(victim);
    }
    if (round % 150 == 149) expect_equals_fresh_sum(grid, config, held);
  }
  EXPECT_GT(grid.cells_reset_by_contradiction(), 100u);
  for (const auto& entry : held) grid.remove(entry.second);
  int left = 0;
  for (int iy = grid.first_y(); iy < grid.first_y() + grid.size_cells(); ++iy) {
    for (int ix = grid.first_x(); ix < grid.first_x() + grid.size_cells(); ++ix) {
      left += grid.weight_units(ix, iy) != 0 || grid.weighted_sum_units(ix, iy) != 0 || grid.known(ix, iy) ||
                      grid.value(ix, iy) != TsdfGrid::kUnknown
                  ? 1
                  : 0;
    }
  }
  EXPECT_EQ(left, 0);
}
INSTANTIATE_TEST_SUITE_P(Sensors, AddRemoveProperty, ::testing::Combine(::testing::Bool(), ::testing::Bool()),
                         [](const auto& kind) {
                           return std::string(std::get<0>(kind.param) ? "Profile" : "Scan") +
                                  (std::get<1>(kind.param) ? "Vectors" : "Plain");
                         });

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
