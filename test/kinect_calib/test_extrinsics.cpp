// The camera's place on the robot and odometry's time, against the simulator that knows them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "kinect_calib/extrinsics_calibrator.h"
#include "test/kinect_calib/simulated_drive.h"

namespace knav {
namespace {

constexpr double kDegree = kPi / 180.0;
constexpr int kFloorFrames = 15;  // while it stands, at the start

/// As many calibrators as there are odometries, over one drive.
struct Variant {
  std::function<void(double* stamp_s, Pose2* pose)> change;
  ExtrinsicsCalibrator calibrator{ExtrinsicsConfig{}};
};

void drive(const SimulatorConfig& config, double end_s, std::vector<Variant>* variants) {
  SimulatedDrive simulated;
  simulated.config = config;
  simulated.end_s = end_s;
  int frames = 0;
  simulated.frame = [&](const cv::Mat& depth, const Simulator& simulator, double stamp_s) {
    ++frames;
    for (Variant& variant : *variants) {
      if (frames <= kFloorFrames || frames % 5 == 0)
        variant.calibrator.add_floor_frame(depth, simulator.camera(), stamp_s);
      if (frames <= kFloorFrames) continue;
      variant.calibrator.add_motion_frame(depth, simulator.camera(), variant.calibrator.floor().mount(),
                                          stamp_s);
    }
  };
  simulated.odometry = [&](double stamp_s, const Pose2& pose) {
    for (Variant& variant : *variants) {
      double stamp = stamp_s;
      Pose2 changed = pose;
      if (variant.change) variant.change(&stamp, &changed);
      variant.calibrator.add_odometry(stamp, changed);
    }
  };
  simulated.run();
}

std::string refusal(const ExtrinsicsCalibrator& calibrator) {
  try {
    calibrator.result();
  } catch (const UserError& error) {
    return error.what();
  }
  return "";
}

TEST(Extrinsics, FindsATiltedCameraAndTheTimeOffsetAndRefusesReversedOdometry) {
  std::vector<Variant> variants(2);
  variants[0].change = [](double* stamp_s, Pose2*) { *stamp_s += 0.040; };
  variants[1].change = [](double*, Pose2* pose) { pose->yaw_rad = -pose->yaw_rad, pose->y_m = -pose->y_m; };
  SimulatorConfig config = tilted_camera();
  config.odometry = "perfect";
  drive(config, 1e9, &variants);
  const ExtrinsicsResult r = variants[0].calibrator.result();
  EXPECT_NEAR(r.floor.height_m.value, 0.43, 0.003);
  EXPECT_NEAR(r.floor.pitch_rad.value, 4.0 * kDegree, 0.1 * kDegree);
  EXPECT_NEAR(r.floor.roll_rad.value, -2.0 * kDegree, 0.1 * kDegree);
  // What the sensor's residual error (1.25 % at 10 m) turns into.
  EXPECT_NEAR(r.motion.yaw_rad.value, 3.0 * kDegree, 0.7 * kDegree);
  EXPECT_NEAR(r.motion.forward_m.value, 0.12, 0.02);
  EXPECT_NEAR(r.motion.left_m.value, 0.0, 0.01);
  EXPECT_NEAR(r.motion.time_offset_s.value, 0.040, 0.004);
  EXPECT_NEAR(r.motion.turn_scale.value, 1.0, 0.02);
  EXPECT_NEAR(r.motion.distance_scale.value, 1.0, 0.02);
  // Standard errors are neither nothing nor excuses.
  EXPECT_GT(r.motion.time_offset_s.sd, 1e-4);
  EXPECT_LT(r.motion.time_offset_s.sd, 0.004);
  EXPECT_GT(r.motion.yaw_rad.sd, 0.01 * kDegree);
  EXPECT_THAT(refusal(variants[1].calibrator), testing::HasSubstr("reverse the sign"));
}

TEST(Extrinsics, AStandingRobotIsRefusedWithWhatToDrive) {
  std::vector<Variant> variants(1);
  drive(tilted_camera(), 1.2, &variants);
  EXPECT_THAT(refusal(variants[0].calibrator), testing::HasSubstr("turn in place"));
}

/// A camera level and 0.5 m up; columns left of the middle see a plane `nearer_m` below it.
cv::Mat two_levels(const PinholeModel& camera, double floor_m, double nearer_m) {
  cv::Mat depth(camera.height_px, camera.width_px, CV_32FC1);
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u) {
      const double y = (v - camera.cy_px) / camera.fy_px, below = u < 200 ? nearer_m : floor_m;
      depth.at<float>(v, u) = y > 0.05 ? static_cast<float>(below / y) : 5.0f;
    }
  }
  return depth;
}

const PinholeModel kCamera = {640, 480, 585.0, 585.0, 319.5, 239.5};

TEST(FloorFinder, TakesTheFloorNotTheTableNorTheWall) {
  FloorFinder finder{FloorFinderConfig{}};
  FloorMount mount;
  ASSERT_TRUE(finder.find(two_levels(kCamera, 0.5, 0.25), kCamera, 0, &mount));
  EXPECT_NEAR(mount.height_m, 0.5, 1e-3);
  EXPECT_NEAR(mount.pitch_rad, 0.0, 1e-3);
  EXPECT_NEAR(mount.roll_rad, 0.0, 1e-3);
  EXPECT_FALSE(finder.find(cv::Mat(480, 640, CV_32FC1, 1.5f), kCamera, 1, &mount));
  const float kNaN = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(finder.find(cv::Mat(480, 640, CV_32FC1, kNaN), kCamera, 2, &mount));
}

TEST(FloorFinder, NoFloorIsRefusedWithWhereToStand) {
  ExtrinsicsCalibrator calibrator{ExtrinsicsConfig{}};
  for (int i = 0; i < 20; ++i)
    calibrator.add_floor_frame(cv::Mat(480, 640, CV_32FC1, 1.5f), kCamera, 0.1 * i);
  EXPECT_THAT(refusal(calibrator), testing::HasSubstr("bare floor"));
}

/// Points (forward, left) = (1, slope) / per_m of the wall forward + 0.5 left = 3.
LevelScan wall_scan(const Pose2& T_wall_camera) {
  LevelScan scan;
  for (double slope = -0.5; slope <= 0.5; slope += 0.0035) {
    // The ray's point t (1, slope) in the camera lies on the wall.
    const double c = std::cos(T_wall_camera.yaw_rad), s = std::sin(T_wall_camera.yaw_rad);
    const double a = (c - s * slope) + 0.5 * (s + c * slope),
                 b = 3.0 - T_wall_camera.x_m - 0.5 * T_wall_camera.y_m;
    scan.slope.push_back(slope);
    scan.per_m.push_back(a / b);
    scan.line_at.push_back((c + 0.5 * s) / b);
    scan.line_per_slope.push_back((0.5 * c - s) / b);
  }
  return scan;
}

TEST(LevelScan, AWallTellsTurnAndApproachButNotTheWayAlongIt) {
  const Pose2 moved = {0.10, 0.05, 0.08};
  ScanMotion motion;
  ASSERT_TRUE(align_scans(wall_scan({}), wall_scan(moved), &motion));
  EXPECT_NEAR(motion.T_from_to.yaw_rad, 0.08, 1e-4);
  // Towards the wall: its normal is (1, 0.5).
  EXPECT_NEAR(motion.T_from_to.x_m + 0.5 * motion.T_from_to.y_m, 0.125, 1e-3);
  const Eigen::Vector3d along(-0.5, 1.0, 0.0);
  EXPECT_LT(along.dot(motion.information * along), 1e-6 * motion.information(0, 0));
}

}  // namespace
}  // namespace knav
