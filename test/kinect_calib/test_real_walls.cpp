#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "kinect_calib/wall_leave_one_out.h"

namespace knav {
namespace {

namespace fs = std::filesystem;

std::string folder() {
  const char* variable = std::getenv("KINECT_NAV_REALDATA");
  return std::string(variable != nullptr ? variable : KINECT_NAV_SOURCE_DIR "/../shared/realdata") +
         "/kinect_walls";
}

std::vector<cv::Mat> read_walls(const std::string& device) {
  std::vector<std::string> paths;
  for (const auto& entry : fs::directory_iterator(folder() + "/" + device)) {
    if (entry.path().extension() == ".png") paths.push_back(entry.path().string());
  }
  std::sort(paths.begin(), paths.end());
  std::vector<cv::Mat> walls;
  for (const std::string& path : paths) walls.push_back(cv::imread(path, cv::IMREAD_UNCHANGED));
  return walls;
}

struct Scores {
  double raw = 0.0, published = 0.0, corrected = 0.0, scale_error = 0.0;  // rms over walls [codes]; largest
};

Scores score(const std::string& device, const DisparityCamera& camera, const PixelDisparityModel* published) {
  DepthCalibratorConfig config;
  config.wall_tilt_sd = 0.05;  // a camera put down by hand
  const std::vector<LeaveOneOutWall> walls =
      leave_one_out(read_walls(device), camera, published, config, {"default"});
  Scores scores;
  for (const LeaveOneOutWall& wall : walls) {
    const auto count = static_cast<double>(walls.size());
    const auto square = [&](const WallFlatness& flatness) {
      return flatness.residual_rms_codes * flatness.residual_rms_codes / count;
    };
    scores.raw += square(wall.raw);
    scores.published += square(wall.published);
    scores.corrected += square(wall.models[0]);
    scores.scale_error =
        std::max(scores.scale_error, std::abs(wall.models[0].distance_m / wall.raw.distance_m - 1.0));
  }
  for (double* value : {&scores.raw, &scores.published, &scores.corrected}) *value = std::sqrt(*value);
  return scores;
}

bool absent() {
  if (fs::is_directory(folder())) return false;
  std::printf("KINECT_NAV_SKIP: no walls at %s; set KINECT_NAV_REALDATA.\n", folder().c_str());
  return true;
}

TEST(RealWalls, AWallLeftOutIsAsFlatAsThePublishedModelOfTheseFramesMakesIt) {
  if (absent()) GTEST_SKIP();
  const DisparityCamera camera = {3.121614, -0.002855, {640, 480, 579.8, 586.7, 321.5, 235.0}};
  const PixelDisparityModel published = PixelDisparityModel::load(folder() + "/device_a_published_model.yml");
  const Scores scores = score("device_a", camera, &published);
  EXPECT_LT(scores.published, 0.5 * scores.raw);  // the model is read the right way round
  EXPECT_LE(scores.corrected, 1.1 * scores.published);
  EXPECT_LE(scores.scale_error, 0.005);
}

TEST(RealWalls, ThreeWallsOfAnotherDeviceAreEnoughToFlattenTheFourth) {
  if (absent()) GTEST_SKIP();
  const DisparityCamera camera = {3.273542, -0.002999907, {640, 480, 572.0, 584.1, 325.6, 220.1}};
  const Scores scores = score("device_b", camera, nullptr);
  EXPECT_LE(scores.corrected, 0.75 * scores.raw);
  EXPECT_LE(scores.scale_error, 0.005);
}

}  // namespace
}  // namespace knav
