// Somebody nearer than a Kinect can see hides all behind him: that is how he is seen.
#include <gtest/gtest.h>

#include <cmath>

#include "test/tsdf_local_mapper/room_world.h"
#include "tsdf_local_mapper/local_mapper.h"

namespace knav {
namespace {

constexpr double kFrame_s = 1.0 / 30.0;
const Pose2 kT_base_camera{0.05, 0.0, 0.0};

class CloseObstacleTest : public ::testing::Test {
 protected:
  /// So many frames, in each of which the robot moves.
  void look(int frames, double turn_rad = 0.0, double distance_m = 0.0) {
    for (int i = 0; i < frames; ++i) {
      stamp_s_ += kFrame_s;
      robot_.drive(distance_m, turn_rad);
      mapper_.add_odometry(stamp_s_, robot_.T_odom_base);
      DepthProfile profile = world_.profile(robot_.T_world_base * kT_base_camera, stamp_s_);
      for (int u = hole_from_; u < hole_to_; ++u) {
        const auto column = static_cast<std::size_t>(u);
        profile.z_m[column] = profile.free_from_m[column] = profile.free_to_m[column] = std::nanf("");
        profile.height_class[column] = HeightClass::kBlind;
      }
      mapper_.update(profile, kT_base_camera);
    }
  }
  /// Of the virtual scan, in a direction of the robot's.
  float range_m(double bearing_rad) {
    mapper_.extract_scan_360(&scan_);
    const auto ray = std::lround((bearing_rad - scan_.angle_min_rad) / scan_.angle_increment_rad);
    return scan_.range_m[static_cast<std::size_t>(ray)];
  }
  float evidence(double bearing_rad) {
    mapper_.extract_scan_360(&scan_);
    const auto ray = std::lround((bearing_rad - scan_.angle_min_rad) / scan_.angle_increment_rad);
    return scan_.evidence[static_cast<std::size_t>(ray)];
  }
  /// Occupied cells of the local map nearer to a point than half a metre.
  int occupied_near(double x_m, double y_m) {
    OccupancyGrid map;
    mapper_.extract_local_map(&map);
    int count = 0;
    for (int iy = 0; iy < map.geometry.height_cells; ++iy) {
      for (int ix = 0; ix < map.geometry.width_cells; ++ix) {
        const double d = std::hypot(map.geometry.center_x_m(ix) - x_m, map.geometry.center_y_m(iy) - y_m);
        count += d < 0.5 && map.value[map.geometry.index(ix, iy)] == 100 ? 1 : 0;
      }
    }
    return count;
  }
  /// Stands left of the way, 0.25 to 0.45 m before the camera.
  void somebody_comes() { world_.box(0.3, 0.05, 0.5, 0.45); }
  void he_leaves() { world_ = RoomWorld::furnished(); }

  static LocalMapperConfig config() {
    LocalMapperConfig config;
    config.filter.particles = 200;
    return config;
  }
  LocalMapper mapper_{config()};
  RoomWorld world_ = RoomWorld::furnished();
  DrivenRobot robot_;
  RangeScan scan_;
  int hole_from_ = 0, hole_to_ = 0;
  double stamp_s_ = 100.0;
};

TEST_F(CloseObstacleTest, SomebodyWhoStepsTooCloseStandsInScanAndMap) {
  look(30);
  EXPECT_GT(range_m(0.3), 2.0f);
  EXPECT_EQ(occupied_near(0.4, 0.15), 0);
  somebody_comes();
  look(1);
  // Depth 0.35 m from a camera 0.05 m before the robot's centre: 0.40 m ahead. Seen from the centre at 0.3 rad: 0.40 / cos 0.3.
  EXPECT_NEAR(range_m(0.3), 0.42, 0.03);
  EXPECT_EQ(evidence(0.3), 0.0f) << "the localizer shall not look for him in the map";
  EXPECT_GT(range_m(-0.3), 2.0f) << "he stands on the left only";
  EXPECT_GE(occupied_near(0.4, 0.15), 3);
}

TEST_F(CloseObstacleTest, HeStandsThereAsLongAsHeHidesTheViewAndGoesWithIt) {
  look(30);
  somebody_comes();
  look(900);  // half a minute
  EXPECT_NEAR(range_m(0.3), 0.42, 0.03);
  he_leaves();
  look(1);
  EXPECT_GT(range_m(0.3), 2.0f);
  EXPECT_EQ(occupied_near(0.4, 0.15), 0);
}

TEST_F(CloseObstacleTest, OutOfViewHeIsRememberedForSomeSeconds) {
  look(30);
  somebody_comes();
  look(15);
  look(30, -0.06);  // 103 degrees to the right, in a second
  EXPECT_NEAR(range_m(0.3 + 1.8), 0.42, 0.04);
  EXPECT_GE(occupied_near(0.4, 0.15), 3);
  look(150);  // memory_s
  EXPECT_EQ(occupied_near(0.4, 0.15), 0);
}

TEST_F(CloseObstacleTest, SomebodyMetInATurnIsSeenToo) {
  somebody_comes();
  look(20, -0.06);  // away from him, then back
  look(20, 0.06);
  EXPECT_NEAR(range_m(0.3), 0.42, 0.04);
}

TEST_F(CloseObstacleTest, AWallThatTheMapHasIsNoOneElse) {
  world_.box(1.2, -2.0, 1.4, 1.4);
  look(30);
  look(30, 0.0, 0.68 / 30);
  // The camera is 0.47 m from the wall and sees none of it, and whoever stands before it would be at 0.40 m from the centre.
  EXPECT_NEAR(range_m(0.0), 0.52, 0.04);
}

TEST_F(CloseObstacleTest, ColumnsThatNeverShowAnythingAreTheImagesBorder) {
  hole_from_ = 0;
  for (int i = 0; i < 90; ++i) {
    hole_to_ = 40 + i % 10;  // its width flickers, as at the edge of images registered to colour
    look(1);
  }
  EXPECT_EQ(occupied_near(0.4, 0.2), 0);
  look(20, 0.06);
  EXPECT_EQ(occupied_near(0.4, 0.0), 0);
}

TEST_F(CloseObstacleTest, ANarrowHoleInTheImageIsNobody) {
  look(30);
  hole_from_ = 200;
  hole_to_ = 220;  // 2.0 degrees
  look(30);
  EXPECT_EQ(occupied_near(0.4, 0.1), 0);
  hole_to_ = 0;
  look(1);
  hole_to_ = 250;  // 4.9 degrees
  look(1);
  EXPECT_GE(occupied_near(0.4, 0.1), 1);
}

TEST_F(CloseObstacleTest, TheShadowBesideANearThingIsNobody) {
  // A pillar's edge 0.7 m before the camera, the room's wall behind: 0.075 m x 585 px (1 / 0.7 m - 1 / 5.95 m) = 55 columns.
  world_.box(0.75, -1.0, 1.0, 0.0);
  look(30);
  hole_from_ = 320 - 55;
  hole_to_ = 320;
  look(30);
  EXPECT_GT(range_m(0.05), 2.0f);
  hole_from_ = 320 - 110;
  look(1);
  EXPECT_NEAR(range_m(0.05), 0.40, 0.02);
}

TEST_F(CloseObstacleTest, TheShadowBesideAKnownThingTooNearToSeeIsNobody) {
  // A door post that the map has, 0.47 m before the camera after the drive: a shadow of up to 0.075 m x 585 px / 0.47 m = 93 columns.
  world_.box(1.2, -2.0, 1.4, 0.0);
  look(30);
  look(29, 0.0, 0.68 / 29);
  hole_from_ = 320 - 90;
  hole_to_ = 320;
  look(1, 0.0, 0.0);
  EXPECT_NEAR(range_m(-0.1), 0.52, 0.04) << "the post";
  EXPECT_GT(range_m(0.05), 2.0f);
  EXPECT_GT(range_m(0.12), 2.0f);
  hole_from_ = 320 - 150;
  look(1);
  EXPECT_NEAR(range_m(0.05), 0.40, 0.02) << "wider than any shadow";
}

TEST_F(CloseObstacleTest, ACoveredCameraStopsTheRobotAndANewEpochForgets) {
  look(30);
  hole_to_ = 640;
  look(1);
  EXPECT_NEAR(range_m(0.0), 0.40, 0.03);
  EXPECT_NEAR(range_m(-0.4), 0.43, 0.03);
  mapper_.reset();
  hole_to_ = 0;
  look(1);
  EXPECT_EQ(occupied_near(0.4, 0.0), 0);
}

TEST_F(CloseObstacleTest, ProfilesWithOtherClassesThanColumnsOrWithNonsenseDistancesAreSurvived) {
  look(30);
  DepthProfile profile = world_.profile(kT_base_camera, 0.0);
  const auto give = [&] {
    stamp_s_ += kFrame_s;
    profile.stamp_s = stamp_s_;
    mapper_.add_odometry(stamp_s_, robot_.T_odom_base);
    EXPECT_TRUE(mapper_.update(profile, kT_base_camera).accepted);
  };
  profile.height_class.assign(5000, HeightClass::kBlind);
  give();
  profile.height_class.clear();
  give();
  profile.height_class.assign(640, HeightClass::kMiddle);
  std::fill(profile.height_class.begin() + 200, profile.height_class.begin() + 400, HeightClass::kBlind);
  for (const float z_m : {0.0f, -1.0f, 1e-30f}) {
    profile.z_m[199] = z_m;
    give();
  }
  EXPECT_EQ(occupied_near(0.4, 0.0), 0) << "all of the run may be the shadow of what is at no distance";
}

}  // namespace
}  // namespace knav
