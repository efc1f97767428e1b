#include <gtest/gtest.h>

#include "openni2_driver/kinect_v1/disparity.h"
#include "openni2_driver/kinect_v1/tick_clock.h"

using knav::DisparityTable;

// By hand with the nominal numbers: code 1000 is a shift of (1000 - 800) / 4 - 0.375 = 49.625 px = 5.170925
// cm; 10 (5.170925 * 120 / (7.5 - 5.170925) + 120) = 3864.2 mm. Likewise 805: 0.091175 cm, 1214.8 mm, and
// 1076: 7.150725 cm, 25767.6 mm.
TEST(DisparityTable, FollowsTheZeroPlaneFormulaTo26M) {
  const DisparityTable table;
  EXPECT_EQ(table.mm(805), 1215);
  EXPECT_EQ(table.mm(1000), 3864);
  EXPECT_EQ(table.mm(1076), 25768);
}

// 1077 would be 27.8 m; from 1090 on the formula is negative; 2047 is the Kinect's own "no reading".
TEST(DisparityTable, RefusesCodesThatMeanNothing) {
  const DisparityTable table;
  for (int code = 1077; code <= 2047; ++code) EXPECT_EQ(table.mm(static_cast<uint16_t>(code)), 0) << code;
  EXPECT_EQ(table.mm(0), 0) << "0.32 m is nearer than the Kinect sees";
  EXPECT_EQ(table.mm(65535), 0);
}

TEST(DisparityTable, GrowsWithTheCodeAndHasTheKinectsSteps) {
  const DisparityTable table;
  int before_mm = 0;
  for (int code = 1; code <= 1076; ++code) {
    const int mm = table.mm(static_cast<uint16_t>(code));
    if (mm == 0) {
      EXPECT_EQ(before_mm, 0) << "a hole at code " << code;
      continue;
    }
    // Below 0.6 m a code is less than a millimetre.
    EXPECT_GE(mm, mm < 600 ? before_mm : before_mm + 1) << code;
    // Known of the device: about 47 mm at 4 m and 290 mm at 10 m.
    if (mm > 4000 && before_mm <= 4000) {
      EXPECT_NEAR(mm - before_mm, 47, 4);
    }
    if (mm > 10000 && before_mm <= 10000) {
      EXPECT_NEAR(mm - before_mm, 290, 25);
    }
    before_mm = mm;
  }
}

TEST(TickClock, CountsOverTheWrapOfTheKinectsCounter) {
  knav::TickClock clock;
  uint32_t ticks = 0xFFFFFFFFU - 3000000U;
  EXPECT_EQ(clock.to_us(ticks), 0U);
  for (uint64_t frame = 1; frame <= 5; ++frame) {
    ticks += 2000000U;  // 1/30 s, and past the wrap after the second
    EXPECT_EQ(clock.to_us(ticks), frame * 2000000U / 60U);
  }
}
