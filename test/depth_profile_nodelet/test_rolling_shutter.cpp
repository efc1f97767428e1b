#include <gtest/gtest.h>

#include "analytic_scene.h"
#include "depth_profile_nodelet/rolling_shutter.h"

namespace knav {
namespace {

using test::kinect_camera;
using test::mount;
using test::Scene;
using Outcome = RollingShutterCorrector::Outcome;

constexpr double kReadout_s = 1.0 / 30.0;

/// Odometry of a robot that turns steadily, 100 Hz, facing yaw 0 at stamp 10.
PoseBuffer turning(double speed_radps) {
  PoseBuffer odometry;
  for (int i = -30; i <= 30; ++i) odometry.add(10.0 + 0.01 * i, {0.0, 0.0, speed_radps * 0.01 * i});
  return odometry;
}

/// Pillars before a wall, while the camera turns; the stamp means the middle row.
cv::Mat turning_view(const Scene& scene, double speed_radps) {
  return test::render(scene, kinect_camera(), [&](int v) {
    const double t_s = (v / 479.0 - 0.5) * kReadout_s;
    return mount(0.5, 0.0, 0.0, speed_radps * t_s * 180.0 / M_PI);
  });
}

/// Column of the first step from far to near, per row.
double edge_of_row(const cv::Mat& depth, int v, int from) {
  for (int u = from; u < depth.cols; ++u) {
    if (depth.at<float>(v, u) < 2.5f) return u;
  }
  return -1.0;
}

Scene pillar_scene(double left_m) {
  Scene scene;
  scene.wall(4.0, -50, 100, -5.0, 5.0);
  scene.wall(2.0, left_m - 0.3, 0.3, -5.0, 5.0);  // its left edge is at y = left_m
  return scene;
}

struct EdgeError {
  double rms_px, worst_px;
};
EdgeError edge_error(const cv::Mat& depth, double left_m) {
  const double truth_px = 319.5 - 585.0 * left_m / 2.0;
  double sum = 0.0, worst = 0.0;
  for (int v = 0; v < depth.rows; ++v) {
    const double error = edge_of_row(depth, v, 0) - 0.5 - truth_px;  // the edge lies between two pixels
    sum += error * error;
    worst = std::max(worst, std::abs(error));
  }
  return {std::sqrt(sum / depth.rows), worst};
}

TEST(RollingShutter, VerticalEdgesStandUprightAgain) {
  for (const double speed : {1.0, -1.0}) {
    double sum = 0.0;
    int edges = 0;
    for (double left_m = -0.65; left_m < 1.0; left_m += 0.0837) {
      const cv::Mat sheared = turning_view(pillar_scene(left_m), speed);
      EXPECT_GT(edge_error(sheared, left_m).worst_px, 8.0);
      RollingShutterCorrector corrector{RollingShutterConfig{}};
      cv::Mat unrolled;
      ASSERT_EQ(corrector.correct(sheared, kinect_camera(), 10.0, turning(speed), &unrolled),
                Outcome::kCorrected);
      const EdgeError error = edge_error(unrolled, left_m);
      EXPECT_LE(error.worst_px, 1.01) << left_m << " " << speed;
      sum += error.rms_px * error.rms_px;
      ++edges;
    }
    // The edge is rounded to a pixel by the sensor and once more by the nearest neighbour: sqrt(2 / 12) =
    // 0.41 px for rows by themselves. The mean over many rows leaves the last rounding: sqrt(1 / 12) = 0.29.
    EXPECT_LE(std::sqrt(sum / edges), 0.36) << speed;
  }
}

TEST(RollingShutter, StraighteningCoversNoThinPoleAndLeavesSlantsAlone) {
  RollingShutterConfig plain_config;
  plain_config.straighten_edges = false;
  // Poles of one to three pixels, and a board that leans 20 degrees.
  for (const double width_m : {0.0035, 0.007, 0.0105}) {
    Scene scene;
    scene.wall(4.0, -50, 100, -5.0, 5.0);
    for (double y = -0.8; y < 0.8; y += 0.1537) scene.wall(2.0, y, width_m, -5.0, 5.0);
    const cv::Mat sheared = turning_view(scene, 1.0);
    cv::Mat plain, straight;
    RollingShutterCorrector without(plain_config), with{RollingShutterConfig{}};
    without.correct(sheared, kinect_camera(), 10.0, turning(1.0), &plain);
    with.correct(sheared, kinect_camera(), 10.0, turning(1.0), &straight);
    for (int v = 0; v < 480; v += 5) {
      const auto poles = [&](const cv::Mat& depth) {
        int count = 0;
        for (int u = 1; u < 640; ++u) {
          count += depth.at<float>(v, u) < 3.0f && depth.at<float>(v, u - 1) > 3.0f ? 1 : 0;
        }
        return count;
      };
      ASSERT_EQ(poles(straight), poles(plain)) << width_m << " row " << v;
    }
  }
  Scene leaning;
  leaning.wall(4.0, -50, 100, -5.0, 5.0);
  leaning.patches.push_back({{2.0, -0.5, -1.0}, {0, 0.2819, -0.1026}, {0, 0.728, 2.0}});
  const cv::Mat sheared = turning_view(leaning, 1.0);
  cv::Mat plain, straight;
  RollingShutterCorrector without(plain_config), with{RollingShutterConfig{}};
  without.correct(sheared, kinect_camera(), 10.0, turning(1.0), &plain);
  with.correct(sheared, kinect_camera(), 10.0, turning(1.0), &straight);
  EXPECT_EQ(cv::countNonZero((plain != straight) & (plain == plain)), 0);
}

TEST(RollingShutter, TurnsDepthAsWellAsPosition) {
  Scene wall;
  wall.wall(4.0, -50, 100, -5.0, 5.0);
  const cv::Mat sheared = turning_view(wall, 1.0);
  // First row, 1/60 s before the stamp: the camera looks 0.0167 rad to the right, so its left edge looks more
  // nearly square at the wall: z = 4 / (cos + 0.546 sin) = 3.964 m.
  EXPECT_NEAR(sheared.at<float>(0, 0), 3.964f, 1e-3f);
  RollingShutterCorrector corrector{RollingShutterConfig{}};
  cv::Mat unrolled;
  ASSERT_EQ(corrector.correct(sheared, kinect_camera(), 10.0, turning(1.0), &unrolled), Outcome::kCorrected);
  for (int v = 0; v < 480; v += 7) {
    for (int u = 15; u < 625; ++u) ASSERT_NEAR(unrolled.at<float>(v, u), 4.0f, 0.004f) << u << " " << v;
  }
}

TEST(RollingShutter, PaperVariantShiftsRowsAndIsRightInTheCentreOnly) {
  RollingShutterConfig config;
  config.method = "paper";
  RollingShutterCorrector corrector(config);
  cv::Mat unrolled;
  ASSERT_EQ(corrector.correct(turning_view(pillar_scene(0.15), 1.0), kinect_camera(), 10.0, turning(1.0),
                              &unrolled),
            Outcome::kCorrected);
  EXPECT_LE(edge_error(unrolled, 0.15).worst_px, 1.0);
  ASSERT_EQ(corrector.correct(turning_view(pillar_scene(0.95), 1.0), kinect_camera(), 10.0, turning(1.0),
                              &unrolled),
            Outcome::kCorrected);
  EXPECT_GT(edge_error(unrolled, 0.95).worst_px, 1.5);
}

TEST(RollingShutter, LeavesAStandingRobotsImageAlone) {
  RollingShutterCorrector corrector{RollingShutterConfig{}};
  cv::Mat depth(480, 640, CV_32FC1, cv::Scalar(2.0f)), unrolled;
  EXPECT_EQ(corrector.correct(depth, kinect_camera(), 10.0, turning(0.0), &unrolled), Outcome::kStill);
  EXPECT_TRUE(unrolled.empty());
}

TEST(RollingShutter, SaysWhenOdometryDoesNotCoverTheFrame) {
  RollingShutterCorrector corrector{RollingShutterConfig{}};
  cv::Mat depth(480, 640, CV_32FC1, cv::Scalar(2.0f)), unrolled;
  EXPECT_EQ(corrector.correct(depth, kinect_camera(), 10.0, PoseBuffer(), &unrolled), Outcome::kNoOdometry);
  EXPECT_EQ(corrector.correct(depth, kinect_camera(), 99.0, turning(1.0), &unrolled), Outcome::kNoOdometry);
  EXPECT_EQ(corrector.correct(depth, kinect_camera(), 1.0, turning(1.0), &unrolled), Outcome::kNoOdometry);
}

TEST(RollingShutter, TimeOffsetAndStampRowMoveTheReference) {
  // The same frame, stamped at its first row by a clock that is 20 ms behind odometry's.
  const cv::Mat sheared = turning_view(pillar_scene(0.15), 1.0);
  RollingShutterConfig config;
  config.stamp_row_fraction = 0.0;
  config.time_offset_s = 0.02;
  RollingShutterCorrector corrector(config);
  cv::Mat unrolled;
  const double first_row_s = 10.0 - kReadout_s / 2;
  ASSERT_EQ(corrector.correct(sheared, kinect_camera(), first_row_s - 0.02, turning(1.0), &unrolled),
            Outcome::kCorrected);
  // All rows as seen at the first row's time: its edge is where the sheared image has it in row 0.
  const double first = edge_of_row(sheared, 0, 0);
  for (int v = 0; v < 480; ++v) ASSERT_NEAR(edge_of_row(unrolled, v, 0), first, 1.0) << v;
}

}  // namespace
}  // namespace knav
