#include <gtest/gtest.h>

#include "openni2_driver/device_clock.h"

using knav::DeviceClock;

namespace {
constexpr double kZeroS = 1000.0;  // host time of the device's zero

uint64_t us(double s) { return static_cast<uint64_t>(s * 1e6 + 0.5); }
}  // namespace

TEST(DeviceClock, OneLateFrameDoesNotMoveItsStamp) {
  DeviceClock clock;
  double stamp_s = 0.0;
  for (int i = 0; i < 20; ++i) {
    const double taken_s = i / 30.0;
    const double late_s = i == 15 ? 0.200 : 0.010;
    stamp_s = clock.to_host_s(us(taken_s), kZeroS + taken_s + late_s);
    EXPECT_NEAR(stamp_s, kZeroS + taken_s + 0.010, 2e-6) << "frame " << i;
  }
}

// By hand: differences 1000.030, 1000.010, 1000.020, each the newest of three; their median is 1000.020.
TEST(DeviceClock, TakesTheMedianOfTheLastDifferences) {
  DeviceClock clock(3);
  clock.to_host_s(us(1.0), 1001.030);
  clock.to_host_s(us(2.0), 1002.010);
  EXPECT_NEAR(clock.to_host_s(us(3.0), 1003.020), 1003.020, 1e-6);
  EXPECT_NEAR(clock.offset_s(), 1000.020, 1e-6);
  // The first leaves the window: 1000.010, 1000.020, 1000.040.
  clock.to_host_s(us(4.0), 1004.040);
  EXPECT_NEAR(clock.offset_s(), 1000.020, 1e-6);
  // 1000.020, 1000.040, 1000.050.
  clock.to_host_s(us(5.0), 1005.050);
  EXPECT_NEAR(clock.offset_s(), 1000.040, 1e-6);
}

TEST(DeviceClock, NoFrameIsStampedAfterItsArrival) {
  DeviceClock clock;
  for (int i = 0; i < 30; ++i) {
    const double taken_s = i / 30.0;
    const double arrival_s = kZeroS + taken_s + (i % 3) * 0.004;
    EXPECT_LE(clock.to_host_s(us(taken_s), arrival_s), arrival_s + 1e-9);
  }
}

TEST(DeviceClock, NoStampTwice) {
  DeviceClock clock;
  const double first_s = clock.to_host_s(us(1.0), 1001.0);
  const double second_s = clock.to_host_s(us(1.0), 1001.0);
  EXPECT_GE(second_s - first_s, 0.9e-6);
}

TEST(DeviceClock, FollowsADriftingDevice) {
  DeviceClock clock;
  // 100 ppm fast, for ten minutes: 60 ms in all, never more than the window's share of it behind.
  for (int i = 0; i < 18000; ++i) {
    const double host_s = i / 30.0;
    const double stamp_s = clock.to_host_s(us(host_s * 1.0001), kZeroS + host_s);
    ASSERT_NEAR(stamp_s, kZeroS + host_s, 1e-4) << "frame " << i;
  }
  EXPECT_EQ(clock.jumps(), 0);
}

TEST(DeviceClock, ARecordingThatBeginsAgainIsAJumpNotAStallOfTheStamps) {
  DeviceClock clock;
  for (int i = 0; i < 60; ++i) clock.to_host_s(us(i / 30.0), kZeroS + i / 30.0);
  const double stamp_s = clock.to_host_s(us(0.0), kZeroS + 2.0);
  EXPECT_NEAR(stamp_s, kZeroS + 2.0, 1e-6);
  EXPECT_EQ(clock.jumps(), 1);
}

TEST(DeviceClock, FollowsAHostClockSetBack) {
  DeviceClock clock;
  for (int i = 0; i < 60; ++i) clock.to_host_s(us(i / 30.0), kZeroS + i / 30.0);
  EXPECT_NEAR(clock.to_host_s(us(2.0), 500.0), 500.0, 1e-6);
}
