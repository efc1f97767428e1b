#include <gtest/gtest.h>

#include "allocation_counter.h"
#include "analytic_scene.h"
#include "core/config.h"
#include "core/error.h"
#include "depth_profile_nodelet/front_end.h"

namespace knav {
namespace {

using test::kinect_camera;
using test::mount;
using test::Scene;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

double median_z(const DepthProfile& profile) {
  std::vector<float> z;
  for (const float value : profile.z_m) {
    if (!std::isnan(value)) z.push_back(value);
  }
  if (z.size() < profile.z_m.size() / 2) return -1.0;
  std::nth_element(z.begin(), z.begin() + static_cast<std::ptrdiff_t>(z.size() / 2), z.end());
  return z[z.size() / 2];
}

DepthProfile extract(const cv::Mat& sliced, const DepthProfileConfig& config = {}) {
  ProfileExtractor extractor(config);
  DepthProfile profile;
  extractor.extract(sliced, kinect_camera(), 1.0, 0.5, {}, {}, {}, &profile);
  return profile;
}

TEST(DepthProfile, HasNoBiasTowardsTheCameraUnderCorrelatedNoise) {
  for (const auto& [distance, tolerance] : {std::pair{2.0, 0.01}, {5.0, 0.01}, {10.0, 0.02}, {18.0, 0.05}}) {
    Scene scene;
    scene.floor();
    scene.wall(distance);
    const FrontEndConfig config;
    FrontEnd front_end{config};
    FrontEndConfig paper_config;
    paper_config.depth_profile.method = "paper";
    FrontEnd paper{paper_config};
    cv::Mat depth = test::render(scene, kinect_camera(), mount());
    test::add_kinect_noise(&depth, 11);
    DepthProfile ours, papers;
    ASSERT_TRUE(front_end.process(depth, kinect_camera(), 1.0, mount(), PoseBuffer(), &ours));
    ASSERT_TRUE(paper.process(depth, kinect_camera(), 1.0, mount(), PoseBuffer(), &papers));
    EXPECT_NEAR(median_z(ours) / distance, 1.0, tolerance) << distance;
    // The plain minimum of hundreds of rows lies about 2.5 standard deviations too near.
    if (distance >= 5.0) {
      EXPECT_LT(median_z(papers) / distance, 1.0 - 0.5 * tolerance) << distance;
    }
  }
}

TEST(DepthProfile, WhatLiesBeyondSaturationIsNotSeenInTheNearestOfItsReadings) {
  // Twelve blocks of seven rows, as disparity is matched, each with one answer: 26 m, or some codes nearer, three in ten nearer
  // than 20 m. And the same with a cupboard at 14 m in the lower half.
  cv::Mat open(480, 640, CV_32FC1, cv::Scalar(kNaN));
  for (int v = 160; v < 244; ++v) {
    RandomStream random(7, random_stream::kTest, 0, static_cast<std::uint32_t>(v / 7));
    for (int u = 0; u < 640; ++u) {
      const double codes = 4.0 * std::fabs(random.normal());
      open.at<float>(v, u) = static_cast<float>(1.0 / (1.0 / 26.0 + codes * kInverseDepthPerCode));
    }
  }
  int readings = 0;
  for (const float z : extract(open).z_m) readings += std::isnan(z) ? 0 : 1;
  EXPECT_LE(readings, 64);  // of 640 columns; nearly all had one before
  cv::Mat cupboard = open.clone();
  cupboard.rowRange(200, 244).setTo(14.0f);
  int seen = 0;
  for (const float z : extract(cupboard).z_m) seen += std::fabs(z - 14.0f) < 0.7f ? 1 : 0;
  EXPECT_GE(seen, 600);
}

TEST(DepthProfile, StraysDoNotHideTheWallBehindThem) {
  cv::Mat sliced(480, 640, CV_32FC1, cv::Scalar(kNaN));
  sliced.rowRange(100, 300).setTo(3.0f);
  for (int u = 0; u < 640; ++u) {
    for (int i = 0; i < 20; ++i)
      sliced.at<float>(5 * i + 1, u) = 0.6f + 0.1f * static_cast<float>(i);  // 20 flying pixels
  }
  for (const float z : extract(sliced).z_m) ASSERT_NEAR(z, 3.0f, 0.001f);
  DepthProfileConfig paper;
  paper.method = "paper";
  for (const float z : extract(sliced, paper).z_m) ASSERT_NEAR(z, 0.6f, 0.001f);
}

TEST(DepthProfile, TheNearestSupportedSurfaceWinsOverALargerOneBehind) {
  cv::Mat sliced(480, 640, CV_32FC1, cv::Scalar(kNaN));
  sliced.rowRange(0, 400).setTo(5.0f);
  sliced.rowRange(400, 403).setTo(1.7f);  // three rows: a thin shelf
  for (const float z : extract(sliced).z_m) ASSERT_NEAR(z, 1.7f, 0.001f);
}

TEST(DepthProfile, SaysHowManyRowsShowTheObstacle) {
  cv::Mat sliced(480, 640, CV_32FC1, cv::Scalar(kNaN));
  sliced.rowRange(0, 400).setTo(5.0f);
  sliced(cv::Range(403, 406), cv::Range(0, 320)).setTo(1.7f);
  sliced(cv::Range(403, 443), cv::Range(320, 600)).setTo(1.7f);
  sliced.colRange(639, 640).setTo(kNaN);
  const DepthProfile profile = extract(sliced);
  ASSERT_EQ(profile.rows.size(), 640u);
  EXPECT_EQ(profile.rows[100], 3);
  EXPECT_EQ(profile.rows[400], 40);
  EXPECT_EQ(profile.rows[620], 255) << "400, and a byte holds 255";
  EXPECT_EQ(profile.rows[639], 0);
  DepthProfileConfig paper;
  paper.method = "paper";
  EXPECT_TRUE(extract(sliced, paper).rows.empty());
}

TEST(DepthProfile, NothingBeyondTwentyMetresIsReported) {
  cv::Mat sliced(480, 640, CV_32FC1, cv::Scalar(20.5f));
  const DepthProfile profile = extract(sliced);
  for (std::size_t u = 0; u < 640; ++u) {
    ASSERT_TRUE(std::isnan(profile.z_m[u]));
    ASSERT_EQ(profile.height_class[u], HeightClass::kNone);
  }
}

TEST(DepthProfile, SmoothingKeepsEdges) {
  cv::Mat sliced(480, 640, CV_32FC1, cv::Scalar(2.0f));
  sliced.colRange(320, 640).setTo(2.2f);
  const DepthProfile profile = extract(sliced);
  EXPECT_NEAR(profile.z_m[319], 2.0f, 0.002f);
  EXPECT_NEAR(profile.z_m[320], 2.2f, 0.002f);
}

TEST(Scan, FollowsRep117) {
  DepthProfile profile;
  profile.fx_px = 585.0;
  profile.cx_px = 319.5;
  profile.range_max_m = 20.0;
  profile.z_m.assign(640, kNaN);
  profile.free_from_m.assign(640, kNaN);
  profile.free_to_m.assign(640, kNaN);
  profile.height_class.assign(640, HeightClass::kNone);
  for (std::size_t u = 0; u < 200; ++u) profile.z_m[u] = 4.0f;
  for (std::size_t u = 200; u < 400; ++u) {
    profile.free_from_m[u] = 1.2f;
    profile.free_to_m[u] = 20.0f;
  }
  RangeScan scan;
  const DepthProfileConfig config;
  scan_from_profile(profile, config, &scan);
  ASSERT_EQ(scan.range_m.size(), 640u);
  EXPECT_NEAR(scan.angle_min_rad, -28.5 * M_PI / 180, 1e-9);
  // The image's left is the scan's end: +28 deg is column 319.5 - 585 tan 28 deg = 8.4.
  const auto index = [&](double deg) {
    return static_cast<std::size_t>(
        std::lround((deg * M_PI / 180 - scan.angle_min_rad) / scan.angle_increment_rad));
  };
  EXPECT_NEAR(scan.range_m[index(28.0)], 4.0 / std::cos(28.0 * M_PI / 180), 0.005);
  EXPECT_TRUE(std::isinf(scan.range_m[index(0.0)]));
  EXPECT_TRUE(std::isnan(scan.range_m[index(-20.0)])) << "unknown is not free";
}

TEST(FrontEnd, AllocatesNothingPerFrameInSteadyState) {
  Scene scene;
  scene.floor();
  scene.wall(4.0);
  cv::Mat depth = test::render(scene, kinect_camera(), mount(0.5, 0.5, 1.0));
  test::add_kinect_noise(&depth, 3);
  const cv::Mat millimetres = test::to_millimetres(depth);
  PoseBuffer odometry;
  for (int i = -50; i < 50; ++i) odometry.add(10.0 + 0.01 * i, {0.0, 0.0, 0.008 * i});
  const FrontEndConfig config;
  FrontEnd front_end{config};
  DepthProfile profile;
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(front_end.process(millimetres, kinect_camera(), 10.0, mount(), odometry, &profile));
  }
  ASSERT_EQ(front_end.rolling_shutter_outcome(), RollingShutterCorrector::Outcome::kCorrected);
  const std::size_t before = test::allocation_count();
  for (int i = 0; i < 5; ++i)
    front_end.process(millimetres, kinect_camera(), 10.0, mount(), odometry, &profile);
  EXPECT_EQ(test::allocation_count() - before, 0u);
}

TEST(FrontEnd, PublishesNothingAsFreeFromBrokenFrames) {
  const FrontEndConfig config;
  FrontEnd front_end{config};
  DepthProfile profile;
  const auto process = [&](const cv::Mat& depth, const PinholeModel& camera) {
    return front_end.process(depth, camera, 1.0, mount(), PoseBuffer(), &profile);
  };
  EXPECT_FALSE(process(cv::Mat(), kinect_camera()));
  EXPECT_FALSE(process(cv::Mat(10, 10, CV_16UC1, cv::Scalar(0)), kinect_camera()));
  EXPECT_FALSE(front_end.fault().empty());
  for (const int saturated : {0, 65535}) {
    ASSERT_TRUE(process(cv::Mat(480, 640, CV_16UC1, cv::Scalar(saturated)), kinect_camera()));
    for (std::size_t u = 0; u < 640; ++u) {
      ASSERT_TRUE(std::isnan(profile.z_m[u]) && std::isnan(profile.free_to_m[u])) << saturated;
    }
  }
  ASSERT_TRUE(process(cv::Mat(480, 640, CV_32FC1, cv::Scalar(kNaN)), kinect_camera()));
  ASSERT_TRUE(process(cv::Mat(1, 1, CV_16UC1, cv::Scalar(1000)), {1, 1, 585.0, 585.0, 0.0, 0.0}));
  EXPECT_TRUE(std::isnan(profile.free_to_m[0]));
}

TEST(FrontEnd, RefusesUnknownKeysAndContradictions) {
  EXPECT_THROW(read_config<FloorRemovalConfig>(YAML::Load("{slice_botom_m: 0.1}"), "x"), UserError);
  EXPECT_THROW(read_config<FloorRemovalConfig>(YAML::Load("{slice_bottom_m: 0.4, slice_top_m: 0.2}"), "x"),
               UserError);
  EXPECT_THROW(read_config<DepthProfileConfig>(YAML::Load("{method: minimum}"), "x"), UserError);
  EXPECT_NO_THROW(read_config<FrontEndConfig>(YAML::Load("{rolling_shutter: {method: paper}}"), "x"));
}

}  // namespace
}  // namespace knav
