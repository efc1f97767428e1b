#include "tsdf_localizer/pose_check.h"

#include <gtest/gtest.h>

#include "synthetic_building.h"

namespace knav {
namespace {

/// A corridor 24 m long and 2 m wide.
test::Building corridor() {
  test::Building building{24.0, 2.0, {}};
  building.wall(-0.5, -0.5, 24.5, 0.0);
  building.wall(-0.5, 2.0, 24.5, 2.5);
  building.wall(-0.5, -0.5, 0.0, 2.5);
  building.wall(24.0, -0.5, 24.5, 2.5);
  return building;
}

PoseCheck check(const test::Building& seen, const Pose2& T_seen_base, const test::Building& map, const Pose2& T_map_base,
                const HealthConfig& health) {
  LocalizerConfig config;
  ScanRays rays;
  EXPECT_TRUE(select_rays(make_scan(seen, T_seen_base, test::ScanModel(), 0.0), Pose2(), config, 0, 0.0, 1.0, &rays));
  return check_pose(map.distance_map(), rays, T_map_base, config.measurement, health, true);
}

/// The robot as a point.
HealthConfig without_a_body() {
  HealthConfig health;
  health.body_radius_m = 0.0;
  return health;
}

HealthConfig all_count_the_same() {
  HealthConfig health = without_a_body();
  health.full_range_m = 0.0;
  return health;
}

TEST(PoseCheck, ACabinetThatWasTakenAwayRightBesideTheRobotIsNoReasonForDoubt) {
  test::Building map = corridor();
  map.wall(10.5, -0.3, 13.5, 0.3);
  const Pose2 T{12.0, 0.4, 0.0};
  // It is 0.1 m from the robot and 3 m long: it fills 2 atan(1.5 / 0.1) = 172 of 360 degrees. The rays of 2 atan(1.5 / 0.4) = 150
  // degrees end where it stood, those of the other 22 on the wall beside it, and count half.
  EXPECT_NEAR(check(corridor(), T, map, T, all_count_the_same()).support, 1.0 - (150.0 + 22.0 / 2.0) / 360.0, 0.03);
  // Degrees times metres, at most 3 of them: 0.4 / cos(a) over the 150 are 93, the 22 times 3 are 66, 1.6 / cos(a) and 3 over
  // the other 188 are 444.
  const PoseCheck now = check(corridor(), T, map, T, without_a_body());
  EXPECT_NEAR(now.support, 1.0 - (93.0 + 66.0 / 2.0) / (93.0 + 66.0 + 444.0), 0.03);
  EXPECT_GT(now.fresh_support, HealthConfig().fresh_ok_fraction);
  // It cannot have stood there with the robot, which is 0.2 m wide to either side: what meets it nearer than that is explained.
  EXPECT_GT(check(corridor(), T, map, T, HealthConfig()).support, now.support + 0.03);
}

TEST(PoseCheck, WhereACabinetWasTakenAwayTheRobotMayStand) {
  test::Building map = corridor();
  map.wall(11.0, 0.2, 12.6, 1.0);
  const Pose2 T{12.0, 0.6, 0.0};
  const PoseCheck now = check(corridor(), T, map, T, HealthConfig());
  EXPECT_GT(now.support, 0.95);
  EXPECT_EQ(now.through, 0u);
  // Were it judged from inside of the cabinet, every ray would go through its side.
  EXPECT_EQ(check(corridor(), T, map, T, without_a_body()).explained, 0u);
  // The same where it stands only with a shoulder in it.
  const Pose2 T_beside{12.0, 1.1, 0.0};
  EXPECT_GT(check(corridor(), T_beside, map, T_beside, HealthConfig()).support,
            check(corridor(), T_beside, map, T_beside, without_a_body()).support + 0.1);
}

TEST(PoseCheck, InsideAWallIsNoPlaceTheBetterForIt) {
  // Half a metre off, in the corridor's wall: its other side is not where it is seen.
  const PoseCheck in_the_wall = check(corridor(), {12.0, 0.3, 0.0}, corridor(), {12.0, -0.2, 0.0}, HealthConfig());
  EXPECT_LT(in_the_wall.support, HealthConfig().ok_fraction);
}

TEST(PoseCheck, BehindWhatWasTakenAwayAWallIsAWall) {
  // The robot is in the corridor, its pose in a cabinet beyond the corridor's wall, and the rays go through that wall.
  test::Building map = corridor();
  map.wall(10.0, 3.0, 13.0, 4.0);
  map.height_m = 6.0;
  const PoseCheck beyond = check(corridor(), {12.0, 1.6, 0.0}, map, {12.0, 3.4, 0.0}, HealthConfig());
  EXPECT_GT(beyond.through, 100u);
  EXPECT_LT(beyond.support, HealthConfig().ok_fraction);
}

TEST(PoseCheck, AWrongHeadingIsOneStill) {
  const PoseCheck check_of = check(corridor(), {12.0, 0.4, 0.0}, corridor(), {12.0, 0.4, 0.35}, HealthConfig());
  EXPECT_LT(check_of.support, HealthConfig().ok_fraction);
  EXPECT_LT(check_of.fresh_support, HealthConfig().fresh_ok_fraction);
}

TEST(PoseCheck, WhereAllIsNearAllCountsTheSame) {
  test::Building closet{1.0, 1.0, {}};
  closet.wall(-0.5, -0.5, 0.0, 1.5);
  closet.wall(1.0, -0.5, 1.5, 1.5);
  closet.wall(-0.5, -0.5, 1.5, 0.0);
  closet.wall(-0.5, 1.0, 1.5, 1.5);
  EXPECT_GT(check(closet, {0.5, 0.5, 0.0}, closet, {0.5, 0.5, 0.0}, HealthConfig()).support, 0.99);
  EXPECT_LT(check(closet, {0.5, 0.5, 0.0}, closet, {0.3, 0.5, 0.0}, HealthConfig()).support, HealthConfig().ok_fraction);
}

}  // namespace
}  // namespace knav
