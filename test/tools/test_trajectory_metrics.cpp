#include <gtest/gtest.h>

#include "tools/trajectory_metrics.h"

namespace knav {
namespace {

/// A straight drive of 1 m a second along x; the estimate is `scale` times too long and turns by `turn_rad` a metre.
Trajectory straight(int seconds, double scale, double turn_rad) {
  Trajectory trajectory;
  for (int t = 0; t <= seconds; ++t) trajectory.push_back({double(t), {t * scale, 0.0, t * turn_rad}});
  return trajectory;
}

TEST(SegmentError, IsLengthTimesScaleErrorOnAStraightDrive) {
  const auto error = segment_error(straight(30, 1.1, 0.0), straight(30, 1.0, 0.0), 20.0);
  EXPECT_EQ(error.count, 11);
  EXPECT_NEAR(error.translation_mean_m, 2.0, 1e-9);
  EXPECT_NEAR(error.translation_sd_m, 0.0, 1e-9);
  EXPECT_NEAR(error.rotation_mean_deg, 0.0, 1e-9);
}

TEST(SegmentError, CountsRotationAsAbsoluteDegrees) {
  const auto error = segment_error(straight(10, 1.0, -0.01), straight(10, 1.0, 0.0), 5.0);
  EXPECT_NEAR(error.rotation_mean_deg, 0.05 * 180 / kPi, 1e-9);
}

TEST(RelationError, IsThatOfTheRelativePoseNotOfTheFrame) {
  Trajectory moved = straight(10, 1.0, 0.0);
  for (auto& pose : moved) pose.T_map_robot = Pose2{5, -3, 1.0} * pose.T_map_robot;
  const std::vector<Relation> relations = {{0, 4, {4, 0, 0}}, {1, 9, {8, 0.3, 0.1}}, {8, 99, {1, 0, 0}}};
  const auto all = relation_error(moved, relations, 0.0);
  EXPECT_EQ(all.count, 2);  // the trajectory does not reach 99 s
  EXPECT_NEAR(all.translation_mean_m, 0.15, 1e-9);
  EXPECT_NEAR(all.rotation_mean_deg, 0.05 * 180 / kPi, 1e-9);
  EXPECT_EQ(relation_error(moved, relations, 5.0).count, 1);
}

TEST(AbsoluteTrajectoryError, VanishesAfterRigidAlignmentOnly) {
  Trajectory reference, moved;
  for (int t = 0; t < 10; ++t) {
    reference.push_back({double(t), {double(t), t * t * 0.1, 0.0}});
    moved.push_back({double(t), Pose2{1, 2, 0.7} * reference.back().T_map_robot});
  }
  int matched = 0;
  EXPECT_NEAR(absolute_trajectory_error_m(moved, reference, &matched), 0.0, 1e-9);
  EXPECT_EQ(matched, 10);
  for (auto& pose : moved) pose.T_map_robot.x_m *= 1.2;
  EXPECT_GT(absolute_trajectory_error_m(moved, reference, &matched), 0.1);
}

TEST(BestRigidTransform, RecoversAKnownOne) {
  const Pose2 truth{3, -1, 2.5};
  const std::vector<Point2> from = {{0, 0}, {1, 0}, {0, 2}, {-3, 1}};
  std::vector<Point2> to;
  for (const Point2& p : from) to.push_back(truth * p);
  const Pose2 found = best_rigid_transform(from, to);
  EXPECT_NEAR(found.x_m, 3, 1e-9);
  EXPECT_NEAR(found.y_m, -1, 1e-9);
  EXPECT_NEAR(found.yaw_rad, 2.5, 1e-9);
}

}  // namespace
}  // namespace knav
