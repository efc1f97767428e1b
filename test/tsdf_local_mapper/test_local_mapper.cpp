// The mapper in a room with bad odometry: the pose, the virtual scan, the local map and the window.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "core/error.h"
#include "test/tsdf_local_mapper/local_mapper_test.h"
#include "tsdf_local_mapper/local_mapper.h"

namespace knav {
namespace {

TEST_F(LocalMapperTest, KeepsItsPlaceWithBadOdometry) {
  start();
  tour();
  ASSERT_GT(std::hypot(odometry_error().x_m, odometry_error().y_m), 0.6);
  // Five seeds of this run: mean error 0.034 m and 0.06 deg, largest anywhere on the way 0.067 m.
  EXPECT_LT(std::hypot(error().x_m, error().y_m), 0.10);
  EXPECT_LT(std::fabs(error().yaw_rad), 0.03);
  EXPECT_EQ(mapper_->result().epoch, 0u);
  EXPECT_LT(mapper_->result().particle_lifespan_s, 10.0);
}

TEST_F(LocalMapperTest, SameInputAndSeedGiveTheSameBytesOnOneThreadAndOnThree) {
  std::vector<double> poses[3];
  std::vector<float> scans[3];
  for (int run = 0; run < 3; ++run) {
    if (run == 2) config_.tsdf.threads = config_.filter.threads = 3;
    robot_ = DrivenRobot();
    stamp_s_ = 100.0;
    start();
    for (int i = 0; i < 60; ++i) {
      const LocalMapperResult& result = drive(1, 0.02, 0.02);
      poses[run].insert(poses[run].end(), {result.T_local_base.x_m, result.T_local_base.y_m,
                                           result.T_local_base.yaw_rad, result.covariance(0, 0)});
    }
    RangeScan scan;
    mapper_->extract_scan_360(&scan);
    for (const float r : scan.range_m) scans[run].push_back(std::isnan(r) ? -1.0f : r);
  }
  EXPECT_EQ(poses[0], poses[1]);
  EXPECT_EQ(scans[0], scans[1]);
  EXPECT_EQ(poses[0], poses[2]);
  EXPECT_EQ(scans[0], scans[2]);
}

TEST_F(LocalMapperTest, TheVirtualScanShowsTheRoomAllRound) {
  start();
  tour();
  RangeScan scan;
  mapper_->extract_scan_360(&scan);
  ASSERT_EQ(scan.range_m.size(), 3600u);
  EXPECT_EQ(scan.stamp_s, stamp_s_);
  int answered = 0, good = 0;
  for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
    if (!std::isfinite(scan.range_m[i])) continue;
    ++answered;
    const double angle =
        robot_.T_world_base.yaw_rad + scan.angle_min_rad + static_cast<double>(i) * scan.angle_increment_rad;
    const double truth = world_.range(robot_.T_world_base.x_m, robot_.T_world_base.y_m, angle);
    good += std::fabs(scan.range_m[i] - truth) < 0.15 ? 1 : 0;
  }
  EXPECT_GT(answered, 2600);  // not every corner came into the 57 degrees
  EXPECT_GT(good, answered * 93 / 100);
}

TEST_F(LocalMapperTest, TheLocalMapHasWallsFreeFloorAndUnknown) {
  start();
  tour();
  OccupancyGrid map;
  mapper_->extract_local_map(&map);
  const auto at = [&](double x, double y) {
    return map.value[map.geometry.index(map.geometry.cell_x(x), map.geometry.cell_y(y))];
  };
  EXPECT_EQ(at(1.8, 0.0), 0);    // floor seen on the way
  EXPECT_EQ(at(-6.0, 0.0), -1);  // outside the room
  int wall = 0;
  for (int k = -2; k <= 2; ++k) wall += at(6.0 + 0.05 * k, 1.0) == 100 ? 1 : 0;
  EXPECT_GE(wall, 1);
}

TEST_F(LocalMapperTest, ParkedItKeepsPoseAndWallsAndForgetsNothing) {
  config_.window.duration_s = 20.0;
  start();
  tour();
  drive(20, 0.0, 0.0);
  const Pose2 before = mapper_->result().T_local_base;
  RangeScan scan_before, scan_after;
  mapper_->extract_scan_360(&scan_before);
  drive(30 * 60, 0.0, 0.0);  // a minute, three times the window
  EXPECT_EQ(mapper_->result().outcome, FrameOutcome::kParked);
  EXPECT_LT(distance_m(before, mapper_->result().T_local_base), 0.01);
  EXPECT_LT(std::fabs(before.yaw_rad - mapper_->result().T_local_base.yaw_rad), 0.0035);
  mapper_->extract_scan_360(&scan_after);
  int lost = 0;
  for (std::size_t i = 0; i < scan_before.range_m.size(); ++i) {
    lost += std::isfinite(scan_before.range_m[i]) && !std::isfinite(scan_after.range_m[i]) ? 1 : 0;
  }
  EXPECT_LT(lost, 40);
}

TEST_F(LocalMapperTest, ThePapersClockForgetsWhileParked) {
  config_.window.duration_s = 5.0;
  config_.window.clock = "paper";
  start();
  tour();
  drive(30 * 8, 0.0, 0.0);
  RangeScan scan;
  mapper_->extract_scan_360(&scan);
  EXPECT_TRUE(std::isnan(scan.range_m[0]));  // behind
  EXPECT_LE(mapper_->result().observations, 152);
}

TEST_F(LocalMapperTest, TheWindowLetsGoOfWhatLiesFarBack) {
  config_.window.distance_m = 2.0;
  start();
  tour();
  // The last 2 m were driven at 2 to 2.5 cm a frame.
  EXPECT_GT(mapper_->result().observations, 70);
  EXPECT_LT(mapper_->result().observations, 110);
}

TEST_F(LocalMapperTest, TheCovarianceIsWideAlongACorridorAndNarrowAcross) {
  world_ = RoomWorld();
  world_.walls = {{-100, -1, 100, -1}, {-100, 1, 100, 1}};
  config_.range_max_m = 6.0;
  config_.filter.particles = 1000;
  start();
  drive(150, 0.025, 0.0);
  const Eigen::Matrix3d& covariance = mapper_->result().covariance;
  EXPECT_GT(std::sqrt(covariance(0, 0)), 2.0 * std::sqrt(covariance(1, 1)));
}

TEST_F(LocalMapperTest, AnyLaserScanDrivesItToo) {
  start();
  const double fov = 1.5 * kPi;
  for (int i = 0; i < 100; ++i) {
    robot_.drive(0.06, 0.03);
    stamp_s_ += 0.1;
    mapper_->add_odometry(stamp_s_, robot_.T_odom_base);
    const Pose2 T_base_laser{0.1, 0.0, 0.2};
    ASSERT_TRUE(
        mapper_->update(world_.scan(robot_.T_world_base * T_base_laser, stamp_s_, fov, 540), T_base_laser)
            .accepted);
  }
  // The first pose already carries the first step.
  const Pose2 T_start = Pose2{0.06, 0.0, 0.03};
  const Pose2 e = robot_.T_world_base.inverse() * (T_start * mapper_->result().T_local_base);
  EXPECT_LT(std::hypot(e.x_m, e.y_m), 0.06);
}

TEST(LocalMapperConfig, FaultsAreSentences) {
  LocalMapperConfig config;
  EXPECT_TRUE(config.validate().empty());
  config.window.max_observations = 100000;
  config.range_max_m = 30.0;
  const auto faults = config.validate();
  ASSERT_GE(faults.size(), 2u);
  EXPECT_NE(faults[0].find("overflow"), std::string::npos);
  EXPECT_THROW(LocalMapper{config}, UserError);
}

}  // namespace
}  // namespace knav
