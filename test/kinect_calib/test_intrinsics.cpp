#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "kinect_calib/intrinsics_calibrator.h"

namespace knav {
namespace {

namespace fs = std::filesystem;

constexpr double kSquare_m = 0.05;
const cv::Matx33d kK = {588.0, 0.0, 314.0, 0.0, 591.0, 246.0, 0.0, 0.0, 1.0};
const std::vector<double> kD = {-0.12, 0.15, 0.001, -0.002, 0.0};

/// Draws a board of 9 x 7 squares on white, each pixel the mean of 3 x 3 rays through the lens.
class Renderer {
 public:
  Renderer() {
    std::vector<cv::Point2d> pixels;
    for (int v = 0; v < 480; ++v) {
      for (int u = 0; u < 640; ++u) {
        for (int i = 0; i < 9; ++i) pixels.emplace_back(u + (i % 3 - 1) / 3.0, v + (i / 3 - 1) / 3.0);
      }
    }
    cv::undistortPoints(pixels, rays_, kK, kD);
  }
  /// The middle of the board at `at_m` in the optical frame, turned by a rotation vector.
  cv::Mat view(const cv::Vec3d& turn, const cv::Vec3d& at_m) const {
    cv::Matx33d R;
    cv::Rodrigues(turn, R);
    const cv::Vec3d normal = R * cv::Vec3d(0, 0, 1);
    cv::Mat image(480, 640, CV_16UC1);
    for (int pixel = 0; pixel < 640 * 480; ++pixel) {
      double light = 0.0;
      for (int i = 0; i < 9; ++i) {
        const cv::Point2d& p = rays_[static_cast<std::size_t>(pixel * 9 + i)];
        const cv::Vec3d ray(p.x, p.y, 1.0);
        const cv::Vec3d on_board = R.t() * (ray * (normal.dot(at_m) / normal.dot(ray)) - at_m);
        const double x = on_board[0] / kSquare_m + 4.5, y = on_board[1] / kSquare_m + 3.5;
        const bool inside = x >= 0 && x < 9 && y >= 0 && y < 7;
        const bool dark = inside && (static_cast<int>(x) + static_cast<int>(y)) % 2 == 0;
        light += dark ? 60.0 : x > -0.7 && x < 9.7 && y > -0.7 && y < 7.7 ? 700.0 : 300.0;
      }
      image.at<std::uint16_t>(pixel / 640, pixel % 640) = static_cast<std::uint16_t>(light / 9.0);
    }
    return image;
  }

 private:
  std::vector<cv::Point2d> rays_;
};

ChessboardConfig board() {
  ChessboardConfig config;
  config.square_m = kSquare_m;
  return config;
}

TEST(Intrinsics, ARenderedLensIsFound) {
  const Renderer renderer;
  IntrinsicsCalibrator calibrator(board());
  for (const double x : {-0.13, 0.0, 0.14}) {
    for (const double y : {-0.08, 0.07}) {
      for (const double lean : {-0.6, 0.5}) {
        const cv::Vec3d turn(y > 0 ? lean : 0.2 * lean, y > 0 ? 0.2 * lean : lean, 0.1);
        const cv::Mat image = renderer.view(turn, {x, y, lean > 0 ? 0.75 : 0.85});
        EXPECT_EQ(calibrator.add_view(image), IntrinsicsCalibrator::View::kTaken)
            << x << " " << y << " " << lean;
      }
    }
  }
  EXPECT_EQ(calibrator.add_view(renderer.view({0.5, 0.1, 0.1}, {0.141, 0.07, 0.75})),
            IntrinsicsCalibrator::View::kTooSimilar);
  EXPECT_EQ(calibrator.add_view(cv::Mat(480, 640, CV_16UC1, cv::Scalar(200))),
            IntrinsicsCalibrator::View::kNoBoard);
  EXPECT_THROW(calibrator.add_view(cv::Mat(240, 320, CV_16UC1, cv::Scalar(200))), UserError);
  const IntrinsicsResult result = calibrator.calibrate();
  EXPECT_EQ(result.views, 12);
  EXPECT_LT(result.reprojection_rms_px, 0.1);
  EXPECT_NEAR(result.camera.raw.fx_px, 588.0, 3.0 * result.fx_sd_px);
  EXPECT_NEAR(result.camera.raw.fy_px, 591.0, 3.0 * result.fy_sd_px);
  EXPECT_NEAR(result.camera.raw.cx_px, 314.0, 3.0 * result.cx_sd_px);
  EXPECT_NEAR(result.camera.raw.cy_px, 246.0, 3.0 * result.cy_sd_px);
  EXPECT_LT(std::max({result.fx_sd_px, result.fy_sd_px, result.cx_sd_px, result.cy_sd_px}), 1.0);
  // Where the lens puts rays, against the middle of the image: a shift of all is a turn of the camera.
  const std::vector<cv::Point3d> rays = {
      {0.0, 0.0, 1.0}, {0.4, 0.25, 1.0}, {-0.4, 0.25, 1.0}, {0.4, -0.3, 1.0}, {0.0, 0.3, 1.0}};
  const PinholeModel& k = result.camera.raw;
  const cv::Matx33d K = {k.fx_px, 0.0, k.cx_px, 0.0, k.fy_px, k.cy_px, 0.0, 0.0, 1.0};
  std::vector<cv::Point2d> truth, found;
  cv::projectPoints(rays, cv::Vec3d(), cv::Vec3d(), kK, kD, truth);
  cv::projectPoints(rays, cv::Vec3d(), cv::Vec3d(), K, result.camera.distortion, found);
  for (std::size_t i = 1; i < rays.size(); ++i) {
    EXPECT_LT(cv::norm((truth[i] - truth[0]) - (found[i] - found[0])), 0.5) << rays[i];
  }
}

TEST(Intrinsics, TooFewViewsAreRefused) {
  IntrinsicsCalibrator calibrator(board());
  EXPECT_THROW(calibrator.calibrate(), UserError);
}

TEST(Intrinsics, TheFileIsCameraInfosOwn) {
  RawCamera camera;
  camera.raw = {640, 480, 580.5, 581.5, 315.25, 245.75};
  camera.rectified = {640, 480, 570.5, 571.5, 316.25, 246.75};
  camera.distortion = {-0.1, 0.2, 0.001, 0.002, 0.0};
  const YAML::Node file = YAML::Load(camera_info_text(camera, "depth_A0"));
  EXPECT_EQ(file["image_width"].as<int>(), 640);
  EXPECT_EQ(file["camera_name"].as<std::string>(), "depth_A0");
  EXPECT_EQ(file["distortion_model"].as<std::string>(), "plumb_bob");
  EXPECT_EQ(file["camera_matrix"]["data"].as<std::vector<double>>(),
            (std::vector<double>{580.5, 0, 315.25, 0, 581.5, 245.75, 0, 0, 1}));
  EXPECT_EQ(file["distortion_coefficients"]["data"].as<std::vector<double>>(), camera.distortion);
  EXPECT_EQ(file["projection_matrix"]["data"].as<std::vector<double>>(),
            (std::vector<double>{570.5, 0, 316.25, 0, 0, 571.5, 246.75, 0, 0, 0, 1, 0}));
}

TEST(Intrinsics, ARealCameraComesOutAsPublished) {
  const char* variable = std::getenv("KINECT_NAV_REALDATA");
  const std::string folder =
      std::string(variable != nullptr ? variable : KINECT_NAV_SOURCE_DIR "/../shared/realdata") +
      "/kinect_walls/device_a_chessboard";
  if (!fs::is_directory(folder)) {
    std::printf("KINECT_NAV_SKIP: no chessboards at %s; set KINECT_NAV_REALDATA.\n", folder.c_str());
    GTEST_SKIP();
  }
  std::vector<std::string> paths;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".jpg") paths.push_back(entry.path().string());
  }
  std::sort(paths.begin(), paths.end());
  IntrinsicsCalibrator calibrator(ChessboardConfig{});
  for (const std::string& path : paths) calibrator.add_view(cv::imread(path, cv::IMREAD_UNCHANGED));
  const IntrinsicsResult result = calibrator.calibrate();
  // Published, from the same boards and more: fx 1060.27, fy 1053.03, cx 619.70, cy 513.69. The boards stand
  // in the middle, so the principal point is known to a few pixels only, there as here.
  EXPECT_LT(result.reprojection_rms_px, 0.3);
  EXPECT_NEAR(result.camera.raw.fx_px, 1060.27, 0.01 * 1060.27);
  EXPECT_NEAR(result.camera.raw.fy_px, 1053.03, 0.01 * 1053.03);
  EXPECT_NEAR(result.camera.raw.cx_px, 619.70, 4.0 * std::sqrt(2.0) * result.cx_sd_px);
  EXPECT_NEAR(result.camera.raw.cy_px, 513.69, 4.0 * std::sqrt(2.0) * result.cy_sd_px);
}

}  // namespace
}  // namespace knav
