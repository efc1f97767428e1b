#include <gtest/gtest.h>

#include <cmath>

#include "kinect_sim/depth_renderer.h"
#include "kinect_sim/row_buffer.h"
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

TEST(DepthGeometry, WhatIsLeftOutAsHiddenIsHiddenThroughoutABuildingAndATurn) {
  // A building, so that most faces are behind others; 60 degrees a second and half a metre a second from the first row to the last.
  const WorldConfig world = load_world(std::string(KINECT_NAV_SOURCE_DIR) + "/config/worlds/brin_building.yaml");
  const WorldMeshes meshes(world);
  Scene scene(meshes);
  PinholeModel camera;
  camera.width_px = 640;
  camera.height_px = 480;
  camera.fx_px = camera.fy_px = 585.0;
  camera.cx_px = 319.5;
  camera.cy_px = 239.5;
  DepthRenderer renderer(meshes, camera);
  DynamicState state;
  state.people.resize(world.people.size());
  state.door_open_rad.assign(world.doors.size(), 0.0);
  state.timed_solid_present.assign(64, 1);
  scene.update(state);
  Eigen::Matrix3f R_base_optical;
  R_base_optical << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  std::vector<float> z_m(640);
  long different = 0, pixels = 0, far = 0;
  for (const Pose2& start : {Pose2{0.0, 0.0, 0.0}, Pose2{20.0, -0.3, 1.6}, Pose2{40.0, 3.0, 2.5}, Pose2{60.0, -8.0, -2.0}, Pose2{50.0, 6.0, 0.3}}) {
    const auto optical = [&](int row) {
      const float share = static_cast<float>(row) / 479.0f;
      Eigen::Isometry3f T = Eigen::Isometry3f::Identity();
      const float yaw = static_cast<float>(start.yaw_rad) + 0.035f * share;
      T.linear() = Eigen::AngleAxisf(yaw, Eigen::Vector3f::UnitZ()).toRotationMatrix() * R_base_optical;
      T.translation() << static_cast<float>(start.x_m) + 0.017f * share * std::cos(yaw), static_cast<float>(start.y_m) + 0.017f * share * std::sin(yaw), 0.5f;
      return T;
    };
    renderer.start_frame(state, optical(0), optical(479));
    for (int v = 0; v < 480; ++v) {
      const Eigen::Isometry3f T = optical(v);
      renderer.render_row(T, v, z_m.data(), nullptr);
      if (v % 7 != 0) continue;
      for (int u = 0; u < 640; u += 5) {
        const Eigen::Vector3f ray(static_cast<float>((u - camera.cx_px) / camera.fx_px), static_cast<float>((v - camera.cy_px) / camera.fy_px), 1.0f);
        const float truth = scene.cast(T.translation(), T.linear() * ray, 60.0f), seen = z_m[static_cast<std::size_t>(u)];
        ++pixels;
        far += truth > 4.0f;
        if (!std::isfinite(truth) && !(seen < 59.0f)) continue;
        if (!(std::abs(truth - seen) <= 1e-3f * truth)) ++different;
      }
    }
  }
  EXPECT_GT(far, pixels / 5);
  // Only pixels whose ray grazes an edge may fall to one side or the other.
  EXPECT_LE(different, pixels / 1000) << "of " << pixels;
}

TEST(RowBuffer, HidesWhatIsNoNearerAllOverItsColumnsAndNothingElse) {
  RowBuffer row(40);
  row.clear();
  EXPECT_FALSE(row.hides(0, 40, 0.1f));
  row.draw(0, 30, 0.5f, 0.0f, 0.0f, 7);  // 2 m, columns 0 to 29
  EXPECT_TRUE(row.hides(0, 16, 0.5f));   // no nearer than what is there
  EXPECT_TRUE(row.hides(3, 14, 0.2f));
  EXPECT_FALSE(row.hides(3, 14, 0.51f));
  EXPECT_FALSE(row.hides(0, 40, 0.2f));   // columns 30 to 39 are open
  EXPECT_FALSE(row.hides(16, 30, 0.2f));  // so are two of their block: it may be drawn for nothing
  row.draw(30, 40, 0.25f, 30.0f, -0.01f, 8);
  EXPECT_TRUE(row.hides(0, 40, 0.16f));
  EXPECT_FALSE(row.hides(0, 40, 0.17f));  // 0.25 - 9 x 0.01 at column 39
  row.draw(0, 40, 0.3f, 0.0f, 0.0f, 9);   // behind the first, before the second
  EXPECT_EQ(row.owner(29), 7);
  EXPECT_EQ(row.owner(30), 9);
  EXPECT_FLOAT_EQ(row.inverse_z(39), 0.3f);
  EXPECT_TRUE(row.hides(0, 40, 0.3f));
  row.clear();
  EXPECT_EQ(row.owner(5), -1);
  EXPECT_FALSE(row.hides(0, 16, 0.1f));
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
