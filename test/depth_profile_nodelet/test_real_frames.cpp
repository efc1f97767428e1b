#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "analytic_scene.h"
#include "depth_profile_nodelet/front_end.h"

namespace knav {
namespace {

std::string folder() {
  const char* variable = std::getenv("KINECT_NAV_REALDATA");
  return std::string(variable != nullptr ? variable : KINECT_NAV_SOURCE_DIR "/../shared/realdata") +
         "/room_sequence/data";
}

struct Tilt {
  int frame;
  double height_m, pitch_deg, roll_deg;  // as import_depth_images levelled the recording
};
constexpr Tilt kTilts[] = {{0, 1.390, 28.72, -6.18},
                           {60, 1.329, 31.21, -7.97},
                           {120, 1.375, 28.78, -1.22},
                           {180, 1.548, 21.69, -6.46},
                           {240, 1.450, 21.54, 0.13}};

/// The slow way: every pixel back-projected with the exact tilt, the third nearest of those between 8 cm
/// and 1.95 m per levelled column.
std::vector<double> nearest_by_hand(const cv::Mat& depth_mm, const PinholeModel& camera,
                                    const Eigen::Isometry3d& T) {
  std::vector<std::vector<double>> columns(640);
  const Eigen::Vector3d axis = T.linear().col(2);
  const Eigen::Vector3d forward = Eigen::Vector3d(axis.x(), axis.y(), 0.0).normalized();
  const Eigen::Vector3d right(forward.y(), -forward.x(), 0.0);
  for (int v = 0; v < 480; ++v) {
    for (int u = 0; u < 640; ++u) {
      const double z = 0.001 * depth_mm.at<std::uint16_t>(v, u);
      if (z <= 0.0) continue;
      const Eigen::Vector3d p = T * Eigen::Vector3d((u - camera.cx_px) / camera.fx_px * z,
                                                    (v - camera.cy_px) / camera.fy_px * z, z);
      if (p.z() < 0.08 || p.z() > 1.95) continue;
      const double along = forward.dot(p);
      const long column = std::lround(camera.cx_px + camera.fx_px * right.dot(p) / along);
      if (along > 0.0 && column >= 0 && column < 640)
        columns[static_cast<std::size_t>(column)].push_back(along);
    }
  }
  std::vector<double> nearest(640, -1.0);
  for (std::size_t u = 0; u < 640; ++u) {
    if (columns[u].size() < 10) continue;
    std::nth_element(columns[u].begin(), columns[u].begin() + 3, columns[u].end());
    nearest[u] = columns[u][3];
  }
  return nearest;
}

TEST(RealFrames, RoomProfileIsTheNearestFurnitureAndNeverTheFloor) {
  const PinholeModel camera = {640, 480, 585.0, 585.0, 320.0, 240.0};
  for (const Tilt& tilt : kTilts) {
    cv::Mat depth =
        cv::imread(fmt::format("{}/frame-{:06d}.depth.png", folder(), tilt.frame), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(depth.type(), CV_16UC1) << tilt.frame;
    depth.setTo(0, depth == 65535);
    FrontEnd front_end{FrontEndConfig{}};
    DepthProfile profile;
    const Eigen::Isometry3d T = test::mount(tilt.height_m, tilt.pitch_deg, tilt.roll_deg);
    ASSERT_TRUE(front_end.process(depth, camera, 1.0, T, PoseBuffer(), &profile)) << front_end.fault();
    const std::vector<double> expected = nearest_by_hand(depth, camera, T);
    int compared = 0, agree = 0, too_near = 0;
    for (std::size_t u = 0; u < 640; ++u) {
      if (expected[u] < 0.0) continue;
      ++compared;
      agree += std::abs(profile.z_m[u] - expected[u]) < 0.03 + 0.02 * expected[u] ? 1 : 0;
      too_near += profile.z_m[u] < expected[u] - 0.15 ? 1 : 0;
    }
    EXPECT_GT(compared, 500) << tilt.frame;
    EXPECT_GE(agree, 0.85 * compared) << tilt.frame;
    EXPECT_LE(too_near, 0.05 * compared) << tilt.frame << ": floor taken for an obstacle?";
  }
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  if (!std::filesystem::exists(knav::folder())) {
    std::printf("KINECT_NAV_SKIP: no recording at %s\n", knav::folder().c_str());
    return 0;
  }
  return RUN_ALL_TESTS();
}
