// A scanner's keyframe that the mapper left turned is set right by those before and after it; a depth camera's are left alone.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "flat_drive.h"
#include "flat_scan.h"
#include "global_map_builder/scan_settler.h"

namespace knav {
namespace {

using namespace flat_world;

/// Along the first corridor of the ring, a keyframe every 0.2 m, all where they are but for what `wrong` does to them.
Drive scanned_drive(const std::vector<std::pair<std::size_t, Pose2>>& wrong) {
  const std::vector<Wall> walls = ring();
  Drive drive;
  for (std::size_t i = 0; i <= 40; ++i) {
    const double stamp_s = kStart_s + 0.2 * static_cast<double>(i);
    const Pose2 truth{0.2 * static_cast<double>(i), 0.1, 0.0};
    Pose2 believed = truth;
    for (const auto& [at, by] : wrong) believed = at == i ? truth * by : believed;
    RandomStream random(7, random_stream::kTest, i, 0);
    drive.frames.push_back({stamp_s, truth.x_m, believed, truth, kMount, scan_at(walls, truth * kMount, stamp_s, random)});
    drive.keyframes.push_back({stamp_s, truth.x_m, believed, truth, false, false});
    drive.trajectory.push_back({stamp_s, believed});
    if (i > 0) {
      const auto from = static_cast<int>(i) - 1;
      drive.edges.push_back({from, from + 1, drive.keyframes[i - 1].T_drive_base.inverse() * believed, Eigen::Matrix3d::Identity(), false});
    }
  }
  return drive;
}

double heading_error_deg(const Drive& drive, std::size_t keyframe) {
  return std::fabs(normalize_angle_rad(drive.keyframes[keyframe].T_drive_base.yaw_rad)) * 180.0 / kPi;
}

TEST(ScanSettler, SetsRightTheKeyframesThatStandTurned) {
  // One by 6 degrees, two in a row by 25 and 20: what late odometry does to a robot that turns.
  const auto turned = [](double deg) { return Pose2{0.0, 0.0, deg * kPi / 180.0}; };
  Drive drive = scanned_drive({{12, turned(6.0)}, {25, turned(-25.0)}, {26, turned(-20.0)}});
  EXPECT_EQ(settle_scans({}, {}, &drive, [](double) {}), 3) << "each counted once, whatever the passes";
  for (const std::size_t k : {12u, 25u, 26u}) {
    // 361 rays of 8 mm over walls of metres tell a heading to hundredths of a degree; the gate is the search's step.
    EXPECT_LT(heading_error_deg(drive, k), 0.5) << "keyframe " << k;
    EXPECT_LT(std::hypot(drive.keyframes[k].T_drive_base.x_m - 0.2 * static_cast<double>(k), drive.keyframes[k].T_drive_base.y_m - 0.1), 0.03);
    EXPECT_NEAR(drive.edges[k].T_from_to.yaw_rad, drive.keyframes[k + 1].T_drive_base.yaw_rad - drive.keyframes[k].T_drive_base.yaw_rad, 1e-9)
        << "steps go with the keyframes";
    EXPECT_LT(std::fabs(drive.frames[k].T_drive_base.yaw_rad), 0.5 * kPi / 180.0) << "and so do frames";
  }
}

TEST(ScanSettler, LeavesADriveThatFitsToTheBit) {
  Drive drive = scanned_drive({});
  const Drive before = drive;
  EXPECT_EQ(settle_scans({}, {}, &drive, [](double) {}), 0);
  for (std::size_t k = 0; k < drive.keyframes.size(); ++k) {
    EXPECT_EQ(drive.keyframes[k].T_drive_base.yaw_rad, before.keyframes[k].T_drive_base.yaw_rad);
    EXPECT_EQ(drive.keyframes[k].T_drive_base.x_m, before.keyframes[k].T_drive_base.x_m);
  }
}

TEST(ScanSettler, LeavesADepthCamerasDriveAndOneSwitchedOffAlone) {
  const Pose2 turned{0.0, 0.0, 0.3};
  Drive camera = scanned_drive({{20, turned}});
  const std::vector<Wall> walls = ring();
  for (DriveFrame& frame : camera.frames) {
    RandomStream random(7, random_stream::kTest, 0, 0);
    frame.data = profile_at(walls, frame.T_odom_base * kMount, frame.stamp_s, random);
  }
  EXPECT_EQ(settle_scans({}, {}, &camera, [](double) {}), 0);
  Drive drive = scanned_drive({{20, turned}});
  SettlingConfig off;
  off.enabled = false;
  EXPECT_EQ(settle_scans(off, {}, &drive, [](double) {}), 0);
  EXPECT_EQ(drive.keyframes[20].T_drive_base.yaw_rad, 0.3);
}

}  // namespace
}  // namespace knav
