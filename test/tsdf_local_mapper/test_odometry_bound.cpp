// How far alignment may lead from odometry where little is in view. By hand.
#include <gtest/gtest.h>

#include <cmath>

#include "tsdf_local_mapper/odometry_bound.h"

namespace knav {
namespace {

constexpr double kFrame_s = 0.1;
MotionNoise sd;

/// Odometry turns by 0.02 rad a frame for 2 s, 0.4 rad in all; the estimate does not turn at all.
Pose2 after_a_turn(const OdometryBoundConfig& config, double coverage) {
  MotionModelConfig motion;
  motion.rotation_per_rotation = 0.1;
  OdometryBound bound(config, motion);
  Pose2 T_local_base;
  for (int i = 0; i <= 20; ++i) {
    const Pose2 T_odom_base{0.0, 0.0, 0.02 * i};
    T_local_base = Pose2{};
    bound.bound(10.0 + kFrame_s * i, T_odom_base, coverage, &T_local_base, &sd);
  }
  return T_local_base;
}

TEST(OdometryBound, WithLittleInViewTheEstimateStaysWithinSoManyDeviationsOfOdometry) {
  // At half the coverage, 1 of the 2 deviations: 0.1 x 0.4 rad, and the 0.0035 rad that the grid resolves.
  EXPECT_NEAR(after_a_turn({}, 0.25).yaw_rad, 0.4 - 0.04 - 0.0035, 1e-9);
  EXPECT_NEAR(after_a_turn({}, 0.0).yaw_rad, 0.4 - 0.0035, 1e-9);
}

TEST(OdometryBound, WithEnoughInViewAlignmentDecides) {
  EXPECT_EQ(after_a_turn({}, 0.5).yaw_rad, 0.0);
  OdometryBoundConfig off;
  off.coverage = 0.0;
  EXPECT_EQ(after_a_turn(off, 0.0).yaw_rad, 0.0);
}

/// So many windows of 2 s in which the estimate turns 1 % less than odometry, with enough in view, then one with little in view in
/// which it does not turn: by how much it is let differ from odometry over that.
double let_differ_rad(const OdometryBoundConfig& config, int windows) {
  MotionModelConfig motion;
  motion.rotation_per_rotation = 0.1;
  OdometryBound bound(config, motion);
  int i = 0;
  double yaw = 0.0;
  for (; i <= 20 * windows; ++i) {
    Pose2 T_local_base{0.0, 0.0, normalize_angle_rad(yaw = 0.99 * 0.02 * i)};
    EXPECT_FALSE(bound.bound(10.0 + kFrame_s * i, {0.0, 0.0, normalize_angle_rad(0.02 * i)}, 0.8, &T_local_base, &sd));
  }
  Pose2 T_local_base;
  for (const int end = i + 20; i < end; ++i) {
    T_local_base = {0.0, 0.0, normalize_angle_rad(yaw)};
    bound.bound(10.0 + kFrame_s * i, {0.0, 0.0, normalize_angle_rad(0.02 * i)}, 0.25, &T_local_base, &sd);
  }
  return std::abs(normalize_angle_rad(yaw + 0.4 - T_local_base.yaw_rad));
}

TEST(OdometryBound, OdometryThatWasFoundGoodIsWorthMoreThanTheMotionModelSays) {
  // Each window is off by 0.004 of 0.4 rad, 0.1 of the model's deviations: 6 x 0.1 instead of 2 of them, half of that at half the coverage.
  EXPECT_NEAR(let_differ_rad({}, 12), 0.5 * 0.6 * 0.04 + 0.0035, 1e-6);
  EXPECT_NEAR(let_differ_rad({}, 8), 0.04 + 0.0035, 1e-6) << "too few windows to know";
  OdometryBoundConfig off;
  off.learned_sds = 0.0;
  EXPECT_NEAR(let_differ_rad(off, 12), 0.04 + 0.0035, 1e-6);
  OdometryBoundConfig wide;
  wide.learned_sds = 50.0;
  EXPECT_NEAR(let_differ_rad(wide, 12), 0.04 + 0.0035, 1e-6) << "never wider than the model's";
}

TEST(OdometryBound, IsMeasuredOverTheWindowAndNotFrameByFrame) {
  // Wheels 5 % too large, straight on: within 2 x 0.1 m/m at full coverage's edge, so nothing is drawn, however long it lasts.
  MotionModelConfig motion;
  motion.translation_per_translation = 0.1;
  OdometryBound bound({}, motion);
  for (int i = 0; i <= 300; ++i) {
    Pose2 T_local_base{0.019 * i, 0.0, 0.0};
    EXPECT_FALSE(bound.bound(10.0 + kFrame_s * i, {0.02 * i, 0.0, 0.0}, 0.49, &T_local_base, &sd)) << i;
  }
}

TEST(OdometryBound, DrawsAlongAndAcross) {
  MotionModelConfig motion;
  motion.translation_per_translation = 0.1;
  OdometryBound bound({}, motion);
  Pose2 T_local_base;
  bound.bound(10.0, {}, 0.25, &T_local_base, &sd);
  // Odometry: 1 m ahead. The estimate: 0.5 m back and 1.2 m aside of that, 1.3 m off; 0.1 x 1 m and 5 mm are allowed.
  T_local_base = {0.5, 1.2, 0.0};
  EXPECT_TRUE(bound.bound(11.0, {1.0, 0.0, 0.0}, 0.25, &T_local_base, &sd));
  EXPECT_NEAR(std::hypot(T_local_base.x_m - 1.0, T_local_base.y_m), 0.105, 1e-9);
  EXPECT_NEAR(std::atan2(T_local_base.y_m, T_local_base.x_m - 1.0), std::atan2(1.2, -0.5), 1e-9);
  EXPECT_NEAR(sd.forward_m, 0.105, 1e-9);  // one deviation of a metre, and what the grid resolves
}

TEST(OdometryBound, ARateAboveItsRingsOnlyShortensTheWindow) {
  OdometryBound bound({}, {});
  for (int i = 0; i < 5000; ++i) {
    Pose2 T_local_base{0.0001 * i, 0.0, 0.0};
    EXPECT_FALSE(bound.bound(10.0 + 0.001 * i, {0.0001 * i, 0.0, 0.0}, 0.1, &T_local_base, &sd));
  }
}

}  // namespace
}  // namespace knav
