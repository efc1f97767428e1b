// The simulated IR image: chessboards and markers where projection puts them, as a calibration will look for
// them.
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "kinect_sim/simulator.h"

namespace knav {
namespace {

constexpr char kBoardWorld[] =
    "spawn: [0, 0, 0]\n"
    "walls:\n  - {points: [[3.05, -5], [3.05, 5]], thickness_m: 0.1}\n"
    "chessboards:\n  - {at: [1.5, 0.1], yaw_deg: 160, tilt_deg: 15, height_m: 0.6, columns: 9, rows: 7, "
    "square_m: 0.05}\n";

cv::Mat infrared_of(Simulator& simulator) {
  FrameRequest request;
  simulator.request_now(&request);
  cv::Mat image;
  simulator.render_infrared(request, &image);
  return image;
}

cv::Mat eight_bits(const cv::Mat& infrared) {
  cv::Mat image;
  infrared.convertTo(image, CV_8U, 0.25);
  return image;
}

SimulatorConfig still_config() {
  SimulatorConfig config;
  config.sensor = "ideal";
  return config;
}

/// Where a point of the world [m] lies in the IR image, worked out without the renderer. The robot stands at
/// the origin.
Eigen::Vector2d project(const Simulator& simulator, const Eigen::Vector3d& p_world) {
  const Eigen::Vector3d p = simulator.T_base_optical().inverse() * p_world;
  const PinholeModel camera = simulator.infrared_camera();
  return {camera.cx_px + camera.fx_px * p.x() / p.z(), camera.cy_px + camera.fy_px * p.y() / p.z()};
}

TEST(Infrared, AChessboardsCornersAreFoundWhereTheyAre) {
  Simulator simulator(parse_world(kBoardWorld, "board"), still_config());
  const cv::Mat image = eight_bits(infrared_of(simulator));
  std::vector<cv::Point2f> corners;
  ASSERT_TRUE(cv::findChessboardCorners(image, {8, 6}, corners));
  cv::cornerSubPix(image, corners, {5, 5}, {-1, -1},
                   {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 40, 0.001});
  // By hand: the board faces 160 deg and leans back by 15 deg. Its x axis points to the right of one who
  // looks at it, its y axis up.
  const double yaw = 160 * kPi / 180, tilt = 15 * kPi / 180;
  const Eigen::Vector3d x(-std::sin(yaw), std::cos(yaw), 0);
  const Eigen::Vector3d facing(std::cos(yaw), std::sin(yaw), 0);
  const Eigen::Vector3d y = std::cos(tilt) * Eigen::Vector3d::UnitZ() - std::sin(tilt) * facing;
  // A millimetre before the point it hangs at.
  const Eigen::Vector3d middle = Eigen::Vector3d(1.5, 0.1, 0.6) + 0.001 * x.cross(y);
  double worst = 0.0;
  Eigen::Vector2d sum(0, 0);
  for (const cv::Point2f& corner : corners) {
    Eigen::Vector2d nearest(1e9, 0);
    for (int row = 0; row < 6; ++row) {
      for (int column = 0; column < 8; ++column) {
        const Eigen::Vector3d p = middle + x * 0.05 * (column - 3.5) + y * 0.05 * (row - 2.5);
        const Eigen::Vector2d difference = Eigen::Vector2d(corner.x, corner.y) - project(simulator, p);
        if (difference.norm() < nearest.norm()) nearest = difference;
      }
    }
    worst = std::max(worst, nearest.norm());
    sum += nearest;
  }
  // Rays every half pixel place an edge within 0.25 px, a corner within 0.36; the detector adds its own.
  // Nothing may be left of it in the mean.
  EXPECT_LT(worst, 0.5);
  EXPECT_LT((sum / static_cast<double>(corners.size())).norm(), 0.05);
}

TEST(Infrared, TheMarkerIsADarkRingAboutABrightDiscStraightAhead) {
  const char world[] =
      "spawn: [0, 0, 0]\n"
      "walls:\n  - {points: [[2.05, -5], [2.05, 5]], thickness_m: 0.1}\n"
      "markers:\n  - {at: [2.0, 0], yaw_deg: 180, height_m: 0.5, diameter_m: 0.2}\n";
  Simulator simulator(parse_world(world, "marker"), still_config());
  const cv::Mat image = infrared_of(simulator);
  const Eigen::Vector2d middle = project(simulator, {2.0, 0, 0.5});
  const auto at = [&](double dx, double dy) {
    return image.at<std::uint16_t>(static_cast<int>(std::lround(middle.y() + dy)),
                                   static_cast<int>(std::lround(middle.x() + dx)));
  };
  // The camera is 1.95 m away: the rim has a radius of 30 px, the disc of 15.
  EXPECT_GT(at(0, 0), 300);
  EXPECT_LT(at(22, 0), 150);
  EXPECT_LT(at(0, -22), 150);
  EXPECT_GT(at(40, 0), 250);
}

TEST(Infrared, SameSeedSameBytesOtherFrameOtherNoise) {
  Simulator first(parse_world(kBoardWorld, "board"), still_config()),
      second(parse_world(kBoardWorld, "board"), still_config());
  const cv::Mat a = infrared_of(first), b = infrared_of(second);
  EXPECT_EQ(cv::norm(a, b, cv::NORM_INF), 0.0);
  first.step();
  EXPECT_GT(cv::norm(infrared_of(first), b, cv::NORM_INF), 0.0);
}

TEST(Infrared, ABoardIsSeenByTheDepthCameraToo) {
  Simulator simulator(parse_world(kBoardWorld, "board"), still_config());
  FrameRequest request;
  simulator.request_now(&request);
  cv::Mat depth_mm;
  simulator.render(request, &depth_mm);
  const Eigen::Vector3d p = simulator.T_base_optical().inverse() * Eigen::Vector3d(1.5, 0.1, 0.6);
  const PinholeModel& camera = simulator.camera();
  const auto u = static_cast<int>(std::lround(camera.cx_px + camera.fx_px * p.x() / p.z()));
  const auto v = static_cast<int>(std::lround(camera.cy_px + camera.fy_px * p.y() / p.z()));
  EXPECT_NEAR(depth_mm.at<std::uint16_t>(v, u), 1000.0 * p.z(), 3.0);
}

TEST(Infrared, AFaultInABoardNamesItsKey) {
  try {
    parse_world(
        "spawn: [0, 0, 0]\nchessboards:\n  - {at: [1, 0], yaw_deg: 0, height_m: 1, columns: 9, rows: 7}\n",
        "w.yaml");
    FAIL() << "accepted";
  } catch (const UserError& error) {
    EXPECT_NE(std::string(error.what()).find("square_m"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace knav
