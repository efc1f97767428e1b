#include <gtest/gtest.h>

#include <cmath>

#include "kinect_sim/depth_renderer.h"
#include "kinect_sim/scene.h"
#include "kinect_sim/simulator.h"

namespace knav {
namespace {

constexpr char kWorld[] = R"(
ceiling_m: 0
spawn: [0, 0, 0]
walls:
  - {points: [[4.05, -10], [4.05, 10]], thickness_m: 0.1, height_m: 8}
boxes:
  - {at: [2.3, 0.8], size: [0.5, 0.4, 1.0]}
cylinders:
  - {at: [2.0, -0.7], radius_m: 0.2, height_m: 1.5}
tables:
  - {at: [3.2, -1.2], size: [0.8, 0.6], yaw_deg: 30}
)";

SimulatorConfig ideal() {
  SimulatorConfig config;
  config.sensor = "ideal";
  config.odometry = "perfect";
  config.robot.slip = 0.0;
  return config;
}

cv::Mat depth_of(Simulator& simulator) {
  FrameRequest request;
  simulator.request_now(&request);
  cv::Mat depth_m;
  simulator.render_true_depth(request, &depth_m);
  return depth_m;
}

TEST(DepthGeometry, AWallIsAtItsDistanceInEveryPixelThatSeesIt) {
  Simulator simulator(parse_world(kWorld, "test"), ideal());
  const cv::Mat depth = depth_of(simulator);
  // Camera at x = 0.05, wall face at x = 4.00; a level camera sees z = 3.95 above the floor line.
  EXPECT_NEAR(depth.at<float>(100, 320), 3.95f, 1e-4f);
  EXPECT_NEAR(depth.at<float>(239, 330), 3.95f, 1e-4f);
  EXPECT_NEAR(depth.at<float>(10, 639), 3.95f, 1e-4f);
}

TEST(DepthGeometry, TheFloorIsWhereTheCameraHeightSays) {
  Simulator simulator(parse_world(kWorld, "test"), ideal());
  const cv::Mat depth = depth_of(simulator);
  // Row 450 looks down by (450 - 239.5) / 585; height 0.5.
  EXPECT_NEAR(depth.at<float>(450, 320), 0.5 * 585.0 / (450 - 239.5), 1e-4);
  EXPECT_NEAR(depth.at<float>(479, 5), 0.5 * 585.0 / (479 - 239.5), 1e-4);
}

TEST(DepthGeometry, ABoxHidesWhatIsBehindItFromEdgeToEdge) {
  Simulator simulator(parse_world(kWorld, "test"), ideal());
  const cv::Mat depth = depth_of(simulator);
  // Front face x = 2.05 (z = 2.00), y from 0.6 to 1.0: columns 319.5 - 585 y / z = 27 ... 144.
  EXPECT_NEAR(depth.at<float>(239, 30), 2.0f, 1e-4f);
  EXPECT_NEAR(depth.at<float>(239, 143), 2.0f, 1e-4f);
  EXPECT_GT(depth.at<float>(239, 26), 2.01f);  // its side is seen obliquely or the wall
  EXPECT_GT(depth.at<float>(239, 146), 2.01f);
}

TEST(DepthGeometry, EveryPixelAgreesWithARayCastByEmbree) {
  const WorldConfig world = parse_world(kWorld, "test");
  Simulator simulator(world, ideal());
  simulator.set_pose({0.1, -0.2, 0.15});
  const cv::Mat depth = depth_of(simulator);
  const WorldMeshes meshes(world);
  const Scene scene(meshes);
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << 0.1, -0.2, 0.0;
  T.linear() = Eigen::AngleAxisd(0.15, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  T = T * simulator.T_base_optical();
  int different = 0;
  for (int v = 0; v < 480; v += 3) {
    for (int u = 0; u < 640; u += 3) {
      const Eigen::Vector3d ray((u - 319.5) / 585.0, (v - 239.5) / 585.0, 1.0);
      const float truth = scene.cast(T.translation().cast<float>(), (T.linear() * ray).cast<float>(), 60.0f);
      const float seen = depth.at<float>(v, u);
      if (!std::isfinite(truth) && std::isnan(seen)) continue;
      if (std::abs(truth - seen) > 1e-3f * truth) ++different;
    }
  }
  // Only pixels whose ray grazes an edge may fall to one side or the other.
  EXPECT_LE(different, 20) << "of " << 160 * 214;
}

TEST(DepthGeometry, MillimetresComeOutWithoutNoiseInTheIdealSensor) {
  Simulator simulator(parse_world(kWorld, "test"), ideal());
  FrameRequest request;
  simulator.request_now(&request);
  cv::Mat depth_mm;
  simulator.render(request, &depth_mm);
  EXPECT_EQ(depth_mm.at<std::uint16_t>(100, 320), 3950);
  EXPECT_EQ(depth_mm.at<std::uint16_t>(239, 100), 2000);
}

TEST(RollingShutter, AVerticalEdgeLeansByTheTurnBetweenItsRows) {
  const char* world = R"(
ceiling_m: 0
walls:
  - {points: [[4.0, 0.0], [4.0, 10]], thickness_m: 0.01, height_m: 8}
)";
  Simulator simulator(parse_world(world, "test"), ideal());
  const double w = 1.0;
  FrameRequest request;
  // A hand-made readout: turning on the spot about the base at 1 rad/s, facing the edge in mid-frame.
  request.stamp_s = 200.0;
  request.pose_count = 2;
  const double half_s = 1.0 / 60.0;
  request.T_world_base[0] = {200.0 - half_s, {0, 0, -w * half_s}};
  request.T_world_base[1] = {200.0 + half_s, {0, 0, w * half_s}};
  cv::Mat depth_m;
  simulator.render_true_depth(request, &depth_m);
  // The wall's edge at y = 0 is the right end of what is near 4 m in each row.
  const auto edge_column = [&](int row) {
    int last = -1;
    for (int u = 0; u < 640; ++u) {
      if (depth_m.at<float>(row, u) < 4.5f) last = u;
    }
    return last;
  };
  // Rows 20 and 220 (above the horizon: no floor) are 200 row times apart: 200/479/30 s.
  const double angle = w * 200.0 / 479.0 / 30.0;
  // The camera is 5 cm ahead of the axis it turns about: the edge at 4 m moves 4/3.95 of a pure rotation's
  // columns.
  EXPECT_NEAR(edge_column(220) - edge_column(20), angle * 585.0 * 4.0 / 3.95, 1.1);
}

}  // namespace
}  // namespace knav
