#include <gtest/gtest.h>

#include "core/pose2.h"

namespace knav {
namespace {

TEST(Pose2, ComposesAsWorkedOutByHand) {
  const Pose2 T_a_b{1.0, 2.0, kPi / 2}, T_b_c{3.0, 0.0, kPi};
  const Pose2 T_a_c = T_a_b * T_b_c;
  EXPECT_NEAR(T_a_c.x_m, 1.0, 1e-12);
  EXPECT_NEAR(T_a_c.y_m, 5.0, 1e-12);
  EXPECT_NEAR(T_a_c.yaw_rad, -kPi / 2, 1e-12);
}

TEST(Pose2, InverseUndoes) {
  const Pose2 T{-2.5, 0.7, 2.9};
  const Pose2 I = T * T.inverse();
  EXPECT_NEAR(I.x_m, 0.0, 1e-12);
  EXPECT_NEAR(I.y_m, 0.0, 1e-12);
  EXPECT_NEAR(I.yaw_rad, 0.0, 1e-12);
}

TEST(Pose2, NormalizedAngleLiesInHalfOpenInterval) {
  EXPECT_DOUBLE_EQ(normalize_angle_rad(kPi), kPi);
  EXPECT_DOUBLE_EQ(normalize_angle_rad(-kPi), kPi);
  EXPECT_NEAR(normalize_angle_rad(7.0), 7.0 - 2 * kPi, 1e-12);
}

TEST(Pose2, InterpolationTurnsTheShortWay) {
  const Pose2 half = interpolate({0, 0, 3.0}, {2, 0, -3.0}, 0.5);
  EXPECT_NEAR(half.x_m, 1.0, 1e-12);
  EXPECT_NEAR(std::fabs(half.yaw_rad), kPi, 1e-12);
}

}  // namespace
}  // namespace knav
