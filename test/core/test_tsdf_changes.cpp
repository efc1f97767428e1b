// What comes, leaves or goes out of view: what is seen now against what was seen for long.
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/tsdf_grid.h"
#include "test/core/tsdf_observations.h"

namespace knav {
namespace {

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

}  // namespace
}  // namespace knav
