#include <gtest/gtest.h>

#include "analytic_scene.h"
#include "depth_profile_nodelet/floor_remover.h"
#include "depth_profile_nodelet/profile_extractor.h"

namespace knav {
namespace {

using test::kinect_camera;
using test::mount;
using test::Scene;

struct Seen {
  cv::Mat sliced;
  FloorResult floor;
  DepthProfile profile;
};

Seen look(FloorRemover* remover, cv::Mat depth, const Eigen::Isometry3d& T_base_optical, double stamp_s = 1.0,
          std::uint64_t noise_seed = 1) {
  test::add_kinect_noise(&depth, noise_seed);
  Seen seen;
  remover->process(depth, kinect_camera(), stamp_s, T_base_optical, &seen.sliced, &seen.floor);
  ProfileExtractor extractor{DepthProfileConfig{}};
  extractor.extract(seen.sliced, kinect_camera(), stamp_s, seen.floor.plane.height_m, seen.floor.free_from_m,
                    seen.floor.free_to_m, seen.floor.height_class, &seen.profile);
  return seen;
}
Seen look(const Scene& scene, const Eigen::Isometry3d& T_base_optical,
          const FloorRemovalConfig& config = {}) {
  FloorRemover remover(config);
  return look(&remover, test::render(scene, kinect_camera(), T_base_optical), T_base_optical);
}

int count_between(const std::vector<float>& values, double low, double high) {
  int count = 0;
  for (const float value : values) count += value >= low && value <= high ? 1 : 0;
  return count;
}
int count_nan(const std::vector<float>& values) {
  return static_cast<int>(std::count_if(values.begin(), values.end(), [](float v) { return std::isnan(v); }));
}

TEST(FloorRemover, EmptyFloorAndWallGiveTheWallAlone) {
  Scene scene;
  scene.floor();
  scene.wall(4.0);
  const Seen seen = look(scene, mount());
  EXPECT_EQ(seen.floor.source, FloorSource::kFrame);
  EXPECT_GT(seen.floor.vote_fraction, 0.95);
  EXPECT_NEAR(seen.floor.plane.height_m, 0.5, 0.005);
  EXPECT_EQ(count_between(seen.profile.z_m, 3.96, 4.04), 640);
  // Bottom row: (479 - 239.5) / 585 = 0.4094 down per metre: floor at 0.5 / 0.4094 = 1.221 m.
  EXPECT_EQ(count_between(seen.profile.free_from_m, 1.20, 1.25), 640);
  EXPECT_EQ(count_between(seen.profile.free_to_m, 3.9, 4.04), 640);
  for (const HeightClass c : seen.profile.height_class) EXPECT_EQ(c, HeightClass::kMiddle);
}

TEST(FloorRemover, FindsPitchAndRollThatTheMountDoesNotKnow) {
  Scene scene;
  scene.floor();
  scene.wall(5.0);
  for (const auto& [pitch, roll] : {std::pair{2.0, 0.0}, {-2.0, 0.0}, {0.0, 2.0}, {1.0, -2.0}}) {
    const Eigen::Isometry3d truth = mount(0.51, pitch, roll);
    FloorRemover remover{FloorRemovalConfig{}};
    const Seen seen = look(&remover, test::render(scene, kinect_camera(), truth), mount());
    const FloorPlane expected = FloorPlane::from_mount(truth);
    EXPECT_EQ(seen.floor.source, FloorSource::kFrame);
    EXPECT_LT(std::acos(std::min(1.0, seen.floor.plane.up.dot(expected.up))) * 180 / M_PI, 0.15)
        << pitch << " " << roll;
    EXPECT_NEAR(seen.floor.plane.height_m, 0.51, 0.006);
    // Levelled: the wall square to the robot's way is one distance in every column.
    EXPECT_GE(count_between(seen.profile.z_m, 4.95, 5.05), 620) << pitch << " " << roll;
  }
}

TEST(FloorRemover, LevelsAnyTiltOfTheMount) {
  Scene scene;
  scene.floor();
  scene.wall(2.5);
  for (const auto& [height, pitch, roll] :
       {std::tuple{1.2, 25.0, 0.0}, {1.0, 15.0, 10.0}, {0.9, 10.0, -15.0}}) {
    const Eigen::Isometry3d truth = mount(height, pitch, roll);
    const Seen seen = look(scene, truth);
    EXPECT_EQ(seen.floor.source, FloorSource::kFrame) << pitch;
    EXPECT_GE(count_between(seen.profile.z_m, 2.45, 2.55), 560) << pitch << " " << roll;
    EXPECT_EQ(count_between(seen.profile.z_m, 0.0, 2.4), 0) << pitch << " " << roll;
  }
}

TEST(FloorRemover, KeepsABoxOfFiveCentimetresAndCallsItLow) {
  for (const double distance : {1.4, 2.0, 3.0}) {
    Scene scene;
    scene.floor();
    scene.wall(6.0);
    scene.box(distance, -0.2, 0.3, 0.4, 0.0, 0.05);
    const Seen seen = look(scene, mount());
    const int middle = 320;
    EXPECT_NEAR(seen.profile.z_m[middle], distance, 0.06) << distance;
    EXPECT_EQ(seen.profile.height_class[middle], HeightClass::kLow) << distance;
    EXPECT_LE(seen.profile.free_to_m[middle], distance + 0.06) << distance;
    EXPECT_NEAR(seen.profile.z_m[20], 6.0, 0.15);
  }
}

TEST(FloorRemover, CallsASignOverheadHighAndATableEdgeMiddle) {
  Scene scene;
  scene.floor();
  scene.wall(8.0);
  scene.box(4.5, -0.5, 0.05, 1.0, 1.8, 1.95);
  const Seen sign = look(scene, mount());
  EXPECT_NEAR(sign.profile.z_m[320], 4.5, 0.1);
  EXPECT_EQ(sign.profile.height_class[320], HeightClass::kHigh);
  EXPECT_LE(sign.profile.free_to_m[320], 4.6);

  Scene above;
  above.floor();
  above.wall(8.0);
  above.box(4.5, -0.5, 0.05, 1.0, 2.1, 2.3);
  EXPECT_NEAR(look(above, mount()).profile.z_m[320], 8.0, 0.15);

  Scene table;
  table.floor();
  table.wall(6.0);
  table.box(2.0, -0.6, 0.8, 1.2, 0.66, 0.70);
  const Seen edge = look(table, mount());
  EXPECT_NEAR(edge.profile.z_m[320], 2.0, 0.05);
  EXPECT_EQ(edge.profile.height_class[320], HeightClass::kMiddle);
}

TEST(FloorRemover, NeverTakesAWallForFloor) {
  for (double distance = 0.55; distance < 2.0; distance += 0.05) {
    FloorRemover remover{FloorRemovalConfig{}};
    Scene scene;
    scene.floor();
    scene.wall(distance);
    const Seen seen = look(&remover, test::render(scene, kinect_camera(), mount()), mount());
    EXPECT_EQ(count_between(seen.profile.z_m, distance - 0.02, distance + 0.02), 640) << distance;
    EXPECT_LT(std::acos(std::min(1.0, -seen.floor.plane.up.y())) * 180 / M_PI, 0.5) << distance;
    for (std::size_t u = 0; u < 640; ++u) {
      EXPECT_FALSE(seen.profile.free_to_m[u] > distance + 0.03) << distance;
    }
  }
}

TEST(FloorRemover, PaperVariantRemovesAWallThatFillsTheViewAndDefaultDoesNot) {
  // The paper's vote has no gate: this is why the default has one.
  Scene scene;
  scene.floor();
  scene.wall(0.8);
  FloorRemovalConfig paper;
  paper.fit.method = "paper";
  EXPECT_GT(count_nan(look(scene, mount(), paper).profile.z_m), 600);
  EXPECT_EQ(count_nan(look(scene, mount()).profile.z_m), 0);
}

TEST(FloorRemover, PaperVariantFindsAnEmptyFloor) {
  Scene scene;
  scene.floor();
  scene.wall(4.0);
  FloorRemovalConfig paper;
  paper.fit.method = "paper";
  const Seen seen = look(scene, mount(), paper);
  EXPECT_EQ(seen.floor.source, FloorSource::kFrame);
  EXPECT_GE(count_between(seen.profile.z_m, 3.9, 4.1), 630);
}

TEST(FloorRemover, UsesThePreviousFloorThenTheMountsWhenACrowdHidesIt) {
  FloorRemovalConfig config;
  FloorRemover remover(config);
  Scene open;
  open.floor();
  open.wall(5.0);
  const Eigen::Isometry3d truth = mount(0.5, 1.5, 0.0);
  ASSERT_EQ(look(&remover, test::render(open, kinect_camera(), truth), mount(), 1.0).floor.source,
            FloorSource::kFrame);
  Scene crowd;
  crowd.floor();
  crowd.wall(0.9);
  const cv::Mat hidden = test::render(crowd, kinect_camera(), truth);
  const Seen soon = look(&remover, hidden, mount(), 1.5);
  EXPECT_EQ(soon.floor.source, FloorSource::kPrevious);
  EXPECT_NEAR(std::asin(-soon.floor.plane.up.z()) * 180 / M_PI, 1.5, 0.2);  // still the tilt of before
  EXPECT_EQ(look(&remover, hidden, mount(), 9.0).floor.source, FloorSource::kMount);
  EXPECT_EQ(look(&remover, hidden, mount(), 0.1).floor.source, FloorSource::kMount)
      << "a stamp before the fit's";
}

TEST(FloorRemover, AWideLowBoxDoesNotKeepTheFloorFromBeingFound) {
  // 0.7 m of box 1.5 m ahead: two columns in five see its flat top. The robot has pitched since the last
  // frame.
  Scene scene;
  scene.floor();
  scene.wall(6.0);
  scene.box(1.5, -0.35, 0.4, 0.7, 0.0, 0.05);
  const Eigen::Isometry3d truth = mount(0.5, -1.8, 0.0);
  FloorRemover remover{FloorRemovalConfig{}};
  const Seen seen = look(&remover, test::render(scene, kinect_camera(), truth), mount());
  EXPECT_EQ(seen.floor.source, FloorSource::kFrame);
  EXPECT_NEAR(std::asin(-seen.floor.plane.up.z()) * 180 / M_PI, -1.8, 0.2);
  EXPECT_NEAR(seen.profile.z_m[320], 1.5, 0.06);
}

TEST(FloorRemover, AWallsFootDoesNotKeepTheFloorBesideItFromBeingFound) {
  // Up to column 452 a wall 1.1 m ahead, its foot within the gate of the mount's floor; right of it, in 29 %
  // of the columns, floor. The robot has pitched and rolled, and has found no floor before.
  Scene scene;
  scene.floor();
  scene.wall(1.1, -0.25, 10.0);
  scene.wall(4.0);
  const Eigen::Isometry3d truth = mount(0.5, 1.5, -1.0);
  FloorRemover remover{FloorRemovalConfig{}};
  const Seen seen = look(&remover, test::render(scene, kinect_camera(), truth), mount());
  EXPECT_EQ(seen.floor.source, FloorSource::kFrame);
  const FloorPlane expected = FloorPlane::from_mount(truth);
  EXPECT_LT(std::acos(std::min(1.0, seen.floor.plane.up.dot(expected.up))) * 180 / M_PI, 0.3);
  EXPECT_NEAR(count_between(seen.profile.z_m, 1.05, 1.15), 453, 2);  // 319.5 + 585 x 0.25 / 1.1 = 452.5
}

TEST(FloorRemover, FloorSeenBeyondAHoleAtTheRobotsFeetIsNotFree) {
  // Floor to 1.0 m, below the view's edge; then nothing; floor again from 6 m and a wall at 8 m.
  Scene scene;
  scene.floor(0.0, -50.0, 1.0);
  scene.floor(0.0, 6.0, 9.0);
  scene.wall(8.0);
  const Seen seen = look(scene, mount());
  for (std::size_t u = 0; u < 640; ++u) ASSERT_TRUE(std::isnan(seen.profile.free_to_m[u])) << u;
}

TEST(FloorRemover, StairsDownAreUnknownNeverFree) {
  // Floor to 2.5 m, then steps down, and a wall across the stairwell at 6 m that answers.
  Scene scene;
  scene.floor(0.0, -50.0, 2.5);
  for (int step = 0; step < 12; ++step)
    scene.floor(-0.17 * (step + 1), 2.5 + 0.28 * step, 2.78 + 0.28 * step);
  scene.wall(6.0, -50.0, 100.0, -3.0, 3.0);
  const Seen seen = look(scene, mount());
  EXPECT_EQ(seen.floor.source, FloorSource::kFrame);
  for (std::size_t u = 0; u < 640; ++u) {
    ASSERT_LE(seen.profile.free_to_m[u], 2.7f) << u;
    ASSERT_GE(seen.profile.z_m[u], 5.8f) << u;
  }
}

TEST(FloorRemover, AHoleWithoutEchoEndsFreeSpaceAtItsEdge) {
  Scene scene;
  scene.floor();
  scene.wall(9.0);
  cv::Mat depth = test::render(scene, kinect_camera(), mount());
  for (int v = 240; v < 480; ++v) {  // no reading from the floor between 3 and 4.2 m
    const double floor_m = 0.5 * 585.0 / (v - 239.5);
    if (floor_m > 3.0 && floor_m < 4.2) depth.row(v).setTo(std::numeric_limits<float>::quiet_NaN());
  }
  FloorRemover remover{FloorRemovalConfig{}};
  const Seen seen = look(&remover, depth, mount());
  for (std::size_t u = 0; u < 640; ++u) ASSERT_LE(seen.profile.free_to_m[u], 3.5f) << u;
}

TEST(FloorRemover, AFarWallCarriesFreeSpaceBeyondWhatTheFloorConfirms) {
  Scene scene;
  scene.floor();
  scene.wall(14.0);
  const Seen seen = look(scene, mount());
  EXPECT_GE(count_between(seen.profile.free_to_m, 12.5, 15.0), 600);

  Scene open;  // nothing answers: free no farther than the floor is seen
  open.floor(0.0, -50.0, 7.0);
  const Seen nothing = look(open, mount());
  EXPECT_EQ(count_nan(nothing.profile.z_m), 640);
  EXPECT_EQ(count_between(nothing.profile.free_to_m, 5.0, 7.3), 640);
}

TEST(FloorRemover, NothingIsFreeWhereTheFloorIsNotInView) {
  Scene scene;
  scene.floor();
  scene.wall(3.0);
  const Eigen::Isometry3d up = mount(1.3, -25.0);  // looks up: sees no floor
  const Seen seen = look(scene, up);
  EXPECT_EQ(seen.floor.source, FloorSource::kMount);
  EXPECT_EQ(count_nan(seen.profile.free_to_m), 640);
  FloorRemovalConfig hand_held;
  hand_held.free_without_floor = true;
  EXPECT_EQ(count_nan(look(scene, up, hand_held).profile.free_to_m) == 640,
            count_nan(seen.profile.z_m) == 640);
}

TEST(FloorRemover, ColumnsWithoutAnyReadingAreBlindIfTheFloorIsInView) {
  Scene scene;
  scene.floor();
  scene.wall(4.0);
  const auto blind = [&](const Eigen::Isometry3d& T_base_optical) {
    FloorRemover remover{FloorRemovalConfig{}};
    cv::Mat depth = test::render(scene, kinect_camera(), T_base_optical);
    depth.colRange(100, 300).setTo(std::numeric_limits<float>::quiet_NaN());
    const Seen seen = look(&remover, depth, T_base_optical);
    std::vector<int> columns;
    for (int u = 0; u < 640; ++u) {
      if (seen.profile.height_class[static_cast<std::size_t>(u)] == HeightClass::kBlind) columns.push_back(u);
    }
    return columns;
  };
  const std::vector<int> level = blind(mount());
  ASSERT_EQ(level.size(), 200u);
  EXPECT_EQ(level.front(), 100);
  EXPECT_EQ(level.back(), 299);
  EXPECT_TRUE(blind(mount(1.3, -25.0)).empty()) << "it looks up, where there may be nothing to see";
}

TEST(FloorRemover, SurvivesFramesThatShowNothing) {
  FloorRemover remover{FloorRemovalConfig{}};
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (const float value : {nan, inf, 0.0f, -1.0f, 30.0f}) {
    cv::Mat depth(480, 640, CV_32FC1, cv::Scalar(value)), sliced;
    FloorResult floor;
    remover.process(depth, kinect_camera(), 1.0, mount(), &sliced, &floor);
    EXPECT_EQ(count_nan(floor.free_to_m), 640) << value;
    EXPECT_EQ(floor.source, FloorSource::kMount) << value;
  }
  cv::Mat pixel(1, 1, CV_32FC1, cv::Scalar(1.0f)), sliced;
  FloorResult floor;
  remover.process(pixel, {1, 1, 585.0, 585.0, 0.0, 0.0}, 1.0, mount(), &sliced, &floor);
  EXPECT_EQ(floor.free_to_m.size(), 1u);
  EXPECT_TRUE(std::isnan(floor.free_to_m[0]));
}

}  // namespace
}  // namespace knav
