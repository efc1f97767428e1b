#include <gtest/gtest.h>

#include <cmath>

#include "tools/parked_accuracy.h"

namespace knav {
namespace {

/// 5 m to the north-east, a stop of 100 s, and on along the robot's heading, ten poses a second.
Trajectory drive_stop_and_drive() {
  Trajectory truth;
  const Pose2 T_map_start{2.0, -1.0, 0.8};
  for (int i = 0; i <= 100; ++i) truth.push_back({0.1 * i, T_map_start * Pose2{0.05 * i, 0.0, 0.0}});
  for (int i = 1; i <= 1000; ++i) truth.push_back({10.0 + 0.1 * i, truth[100].T_map_robot});
  for (int i = 1; i <= 300; ++i) truth.push_back({110.0 + 0.1 * i, T_map_start * Pose2{5.0 + 0.05 * i, 0.0, 0.0}});
  return truth;
}

TEST(ParkedAccuracy, TellsWhatTheEstimateDidDuringTheLongestStopAndTenMetresLater) {
  const Trajectory truth = drive_stop_and_drive();
  // The estimate is off by metres as a whole; while the robot stands it goes 6 mm and 0.1 deg astray and comes back, and after it
  // it takes the way for 1 % too long.
  Trajectory estimate = truth;
  const Pose2 T_stop = truth[100].T_map_robot;
  for (StampedPose2& pose : estimate) {
    Pose2 T_stop_now = T_stop.inverse() * pose.T_map_robot;
    if (std::abs(pose.stamp_s - 50.0) < 0.01) T_stop_now = {0.0, 0.006, 0.1 * kPi / 180.0};
    if (pose.stamp_s > 110.0) T_stop_now.x_m *= 1.01;
    pose.T_map_robot = Pose2{7.0, 3.0, -2.0} * T_stop_now;
  }
  const std::vector<ScanShare> shares = {{5.0, 0.2}, {12.0, 0.9}, {60.0, 0.8}, {80.0, 0.7}, {109.0, 0.6}, {120.0, 0.1}};
  const ParkedAccuracy accuracy = parked_accuracy(estimate, truth, shares);
  EXPECT_NEAR(accuracy.parked_s, 100.0, 0.2);
  EXPECT_NEAR(accuracy.moved_m, 0.006, 1e-9);
  EXPECT_NEAR(accuracy.turned_deg, 0.1, 1e-9);
  EXPECT_NEAR(accuracy.later_m, 0.1, 1e-3);  // 1 % of 10 m
  EXPECT_NEAR(accuracy.seen_before, 0.85, 1e-9);  // from 11 s to 71 s
  EXPECT_NEAR(accuracy.seen_after, 0.7, 1e-9);    // from 50 s to 110 s
  EXPECT_TRUE(std::isnan(parked_accuracy(estimate, truth, {}).seen_after));
}

TEST(ParkedAccuracy, IsEmptyWithoutPoses) { EXPECT_EQ(parked_accuracy({}, {}, {}).parked_s, 0.0); }

TEST(ScanShare, CountsWhatIsWithinEightMetresAndShown) {
  RangeScan perfect, scan;
  perfect.range_m = {2.0f, 4.0f, 6.0f, 9.0f};
  scan.range_m = {2.2f, 5.0f, std::nanf(""), 9.0f};
  EXPECT_NEAR(ScanShare::of(scan, perfect).seen, 1.0 / 3.0, 1e-9);
}

}  // namespace
}  // namespace knav
