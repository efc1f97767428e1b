#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "core/error.h"
#include "core/random.h"
#include "kinect_calib/depth_calibrator.h"
#include "kinect_calib/depth_corrector.h"
#include "kinect_calib/kinect_noise.h"

namespace knav {
namespace {

const PinholeModel kCamera = {640, 480, 585.0, 585.0, 319.5, 239.5};

/// A smooth ring of disparity offset, not aligned to tiles: up to 0.01 1/m, which is 10 % at 10 m.
double ring_per_m(int u, int v) {
  const double x = (u - 345.0) / 320.0, y = (v - 222.0) / 320.0;
  return 0.01 * std::cos(4.0 * std::hypot(x, y));
}

struct WallView {
  double noise_codes = 0.55;
  double band_codes = 0.0;
  double tilt_x = 0.0;
};

/// What the distorted sensor says of a wall.
cv::Mat wall(double distance_m, std::uint64_t seed, const WallView& view) {
  cv::Mat depth(480, 640, CV_32FC1);
  for (int v = 0; v < 480; ++v) {
    RandomStream random(seed, random_stream::kTest, 7, static_cast<std::uint32_t>(v));
    for (int u = 0; u < 640; ++u) {
      const double band =
          view.band_codes * kInverseDepthPerCode * ((u / 83 + static_cast<int>(seed)) % 2 == 0 ? 1.0 : -1.0);
      const double x = (u - kCamera.cx_px) / kCamera.fx_px;
      const double q = (1.0 + view.tilt_x * x) / distance_m + ring_per_m(u, v) + band +
                       view.noise_codes * kInverseDepthPerCode * random.normal();
      const double code = std::round(q / kInverseDepthPerCode);
      depth.at<float>(v, u) = code > 0 ? static_cast<float>(1.0 / (code * kInverseDepthPerCode))
                                       : std::numeric_limits<float>::quiet_NaN();
    }
  }
  return depth;
}

DepthCalibration calibrate(const WallView& view, double finder_bias_m = 0.0) {
  DepthCalibrator calibrator{DepthCalibratorConfig{}};
  std::uint64_t seed = 1;
  for (double d = 0.5; d <= 4.0; d *= 1.15)
    calibrator.add_frame(wall(d, ++seed, view), kCamera, d + finder_bias_m);
  return calibrator.fit();
}

struct Bias {
  double mean, tile_p95;
};
/// Full images through the corrector, scored against the distance.
Bias bias_at(const DepthCorrectionConfig& config, const DepthCalibration& calibration, double distance_m) {
  DepthCorrector corrector(config, calibration);
  std::vector<double> sum(1200, 0.0), count(1200, 0.0);
  for (std::uint64_t seed = 100; seed < 104; ++seed) {
    cv::Mat corrected;
    EXPECT_TRUE(corrector.correct(wall(distance_m, seed, {}), kCamera, &corrected)) << corrector.fault();
    for (int v = 0; v < 480; ++v) {
      for (int u = 0; u < 640; ++u) {
        const float z = corrected.at<float>(v, u);
        if (std::isnan(z)) continue;
        // In inverse depth: there noise has no bias, so that what is scored is the correction.
        sum[static_cast<std::size_t>(v / 16 * 40 + u / 16)] += 1.0 / z;
        count[static_cast<std::size_t>(v / 16 * 40 + u / 16)] += 1.0;
      }
    }
  }
  std::vector<double> biases;
  double mean = 0.0;
  for (std::size_t i = 0; i < 1200; ++i) {
    const double bias = count[i] / sum[i] / distance_m - 1.0;
    mean += bias / 1200;
    biases.push_back(std::abs(bias));
  }
  std::sort(biases.begin(), biases.end());
  return {mean, biases[1140]};
}

TEST(DepthCalibration, GeneralisesFromFourMetresToTwenty) {
  const DepthCalibration calibration = calibrate({});
  const DepthCorrectionConfig config;
  const DepthCalibration none = DepthCalibration::identity(640, 480, 16);
  EXPECT_GT(bias_at(config, none, 10.0).tile_p95, 0.08);  // the error that is to go
  for (const double distance : {0.62, 1.3, 2.9, 5.0, 7.7, 10.0}) {
    const Bias bias = bias_at(config, calibration, distance);
    EXPECT_LE(std::abs(bias.mean), 0.01) << distance;
    EXPECT_LE(bias.tile_p95, 0.02) << distance;
  }
  for (const double distance : {15.0, 20.0}) {
    const Bias bias = bias_at(config, calibration, distance);
    EXPECT_LE(std::abs(bias.mean), 0.03) << distance;
    EXPECT_LE(bias.tile_p95, 0.06) << distance;
  }
}

TEST(DepthCalibration, PaperModelIsRightWhereItWasTrained) {
  const DepthCalibration calibration = calibrate({});
  DepthCorrectionConfig paper;
  paper.model = "paper";
  for (const double distance : {0.62, 1.3, 2.9, 3.8}) {
    const Bias bias = bias_at(paper, calibration, distance);
    EXPECT_LE(std::abs(bias.mean), 0.01) << distance;
    EXPECT_LE(bias.tile_p95, 0.02) << distance;
  }
  EXPECT_LT(bias_at(paper, calibration, 10.0).tile_p95,
            bias_at(paper, DepthCalibration::identity(640, 480, 16), 10.0).tile_p95);
}

TEST(DepthCalibration, BandsAndAWallThatIsNotSquareAreNotLearned) {
  WallView view;
  view.band_codes = 0.4;
  view.tilt_x = 0.02;
  const DepthCalibration calibration = calibrate(view);
  const Bias bias = bias_at(DepthCorrectionConfig{}, calibration, 10.0);
  EXPECT_LE(std::abs(bias.mean), 0.01);
  EXPECT_LE(bias.tile_p95, 0.025);
}

TEST(DepthCalibration, TheFloorBeforeTheWallIsNotLearned) {
  // A camera 0.5 m up sees floor from 1.22 m on: the lower rows show wall from near only.
  DepthCalibrator calibrator{DepthCalibratorConfig{}};
  std::uint64_t seed = 1;
  for (double d = 0.5; d <= 4.0; d *= 1.15) {
    cv::Mat view = wall(d, ++seed, {});
    for (int v = 241; v < 480; ++v) {
      const double floor_m = 0.5 * 585.0 / (v - 239.5);
      if (floor_m < d) view.row(v).setTo(static_cast<float>(floor_m));
    }
    calibrator.add_frame(view, kCamera, d);
  }
  const Bias bias = bias_at(DepthCorrectionConfig{}, calibrator.fit(), 10.0);
  EXPECT_LE(std::abs(bias.mean), 0.01);
  EXPECT_LE(bias.tile_p95, 0.02);
}

TEST(DepthCalibration, AFrameThatShowsNoSquareWallIsRefused) {
  DepthCalibrator calibrator{DepthCalibratorConfig{}};
  WallView slanted;
  slanted.tilt_x = 0.2;
  EXPECT_THROW(calibrator.add_frame(wall(1.0, 1, slanted), kCamera, 1.0), UserError);
  EXPECT_THROW(calibrator.add_frame(wall(1.0, 1, {}), kCamera, 2.0), UserError) << "not at that distance";
}

TEST(Debander, RemovesStepsAndKeepsTheSmoothError) {
  WallView banded;
  banded.band_codes = 0.4;
  cv::Mat depth = wall(2.0, 4, banded);
  Debander debander;
  EXPECT_EQ(debander.remove_bands(&depth), 7);  // 640 / 83 columns
  ASSERT_EQ(debander.steps().size(), 7u);
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_NEAR(debander.steps()[i].column, 83.0 * static_cast<double>(i + 1), 3.0);
    EXPECT_NEAR(std::abs(debander.steps()[i].step_per_m), 0.8 * kInverseDepthPerCode,
                0.2 * kInverseDepthPerCode);
  }
  // At each edge between bands, of 0.8 codes: what 16 columns on the right say less 16 on the left.
  const cv::Mat clean = wall(2.0, 4, {});
  const auto mean_per_m = [](const cv::Mat& image, int first, int last) {
    double sum = 0.0;
    for (int v = 0; v < image.rows; ++v) {
      for (int u = first; u < last; ++u) sum += 1.0 / image.at<float>(v, u);
    }
    return sum / (image.rows * (last - first));
  };
  for (int edge = 83; edge < 624; edge += 83) {
    const auto step = [&](const cv::Mat& image) {
      return mean_per_m(image, edge, edge + 16) - mean_per_m(image, edge - 16, edge);
    };
    EXPECT_NEAR(step(depth), step(clean), 0.2 * kInverseDepthPerCode) << edge;
  }
  // The frame-wide mean is that of the banded frame.
  EXPECT_NEAR(mean_per_m(depth, 0, 640), mean_per_m(wall(2.0, 4, banded), 0, 640),
              0.01 * kInverseDepthPerCode);
}

TEST(Debander, LeavesAFrameWithoutBandsAlone) {
  for (std::uint64_t seed = 1; seed < 6; ++seed) {
    cv::Mat depth = wall(2.0, seed, {});
    Debander debander;
    EXPECT_EQ(debander.remove_bands(&depth), 0) << seed;
  }
}

TEST(DepthCalibration, RefusesTooFewDistances) {
  DepthCalibrator calibrator{DepthCalibratorConfig{}};
  for (const double d : {1.0, 1.1, 1.2, 1.3}) calibrator.add_frame(wall(d, 1, {}), kCamera, d);
  EXPECT_THROW(calibrator.fit(), UserError);
  EXPECT_THROW(calibrator.add_frame(cv::Mat(480, 640, CV_32FC1, cv::Scalar(NAN)), kCamera, 2.0), UserError);
  EXPECT_THROW(calibrator.add_frame(wall(1.0, 1, {}), kCamera, -1.0), UserError);
}

TEST(DepthCalibration, FileKeepsEveryValueAndFaultsNameFileAndKey) {
  const std::string path =
      (std::filesystem::temp_directory_path() / "kinect_nav_test_calibration.yaml").string();
  DepthCalibration calibration = DepthCalibration::identity(64, 48, 16);
  for (std::size_t i = 0; i < 12; ++i) {
    calibration.inverse_depth_offset_per_m[i] = 1e-4 * static_cast<double>(i) - 5e-4;
    calibration.quadratic_a_per_m[i] = 0.001 * static_cast<double>(i);
  }
  calibration.inverse_depth_scale = 0.0123;
  calibration.device = "A00362A08414119A";
  save_depth_calibration(path, calibration);
  const DepthCalibration loaded = load_depth_calibration(path);
  EXPECT_EQ(loaded.device, calibration.device);
  EXPECT_EQ(loaded.inverse_depth_scale, calibration.inverse_depth_scale);
  EXPECT_THAT(loaded.inverse_depth_offset_per_m,
              testing::Pointwise(testing::DoubleNear(1e-10), calibration.inverse_depth_offset_per_m));
  EXPECT_THAT(loaded.quadratic_a_per_m,
              testing::Pointwise(testing::DoubleNear(1e-8), calibration.quadratic_a_per_m));

  std::ofstream(path) << "format: kinect_nav_depth_calibration\nversion: 1\ndevice: x\nimage_width_px: 640\n";
  try {
    load_depth_calibration(path);
    FAIL();
  } catch (const UserError& error) {
    EXPECT_NE(std::string(error.what()).find(path), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("image_height_px"), std::string::npos);
  }
  std::ofstream(path) << "format: something\n";
  EXPECT_THROW(load_depth_calibration(path), UserError);
  std::filesystem::remove(path);
}

TEST(DepthCorrector, RisesWithDepthAndStaysWithinItsBoundsUnderWildTiles) {
  DepthCalibration wild = DepthCalibration::identity(640, 480, 16);
  for (std::size_t i = 0; i < wild.tile_count(); ++i) {
    wild.linear_offset_per_m[i] = wild.inverse_depth_offset_per_m[i] = i % 2 == 0 ? -0.5 : 0.5;
    wild.quadratic_a_per_m[i] = i % 2 == 0 ? 1.0 : 0.05;
  }
  for (const char* model : {"default", "offset", "paper"}) {
    DepthCorrectionConfig config;
    config.model = model;
    const DepthCorrector corrector(config, wild);
    for (const double u : {8.0, 24.0, 100.0, 639.0}) {
      double last = 0.0;
      for (double z = 0.4; z < 26.0; z += 0.05) {
        const double corrected = corrector.correct_depth_m(u, 100.0, z);
        ASSERT_GT(corrected, last) << model << " " << z;
        ASSERT_LE(corrected, z * config.ratio_max * 1.00001);
        ASSERT_GE(corrected, z / config.ratio_max * 0.99999);
        last = corrected;
      }
    }
  }
}

TEST(DepthCorrector, InterpolatesSmoothlyBetweenTileCentres) {
  DepthCalibration calibration = DepthCalibration::identity(640, 480, 16);
  calibration.linear_offset_per_m[5 * 40 + 10] = 0.01;  // centre at (167.5, 87.5)
  const DepthCorrector corrector(DepthCorrectionConfig{}, calibration);
  EXPECT_NEAR(corrector.correct_depth_m(167.5, 87.5, 5.0), 5.0 / 1.05, 1e-5);
  EXPECT_NEAR(corrector.correct_depth_m(175.5, 87.5, 5.0), 5.0 / 1.025, 1e-5);
  EXPECT_NEAR(corrector.correct_depth_m(183.5, 87.5, 5.0), 5.0, 1e-5);
  // The image gets the same, pixel by pixel.
  DepthCorrector images(DepthCorrectionConfig{}, calibration);
  cv::Mat corrected;
  ASSERT_TRUE(images.correct(cv::Mat(480, 640, CV_16UC1, cv::Scalar(5000)), kCamera, &corrected));
  for (int u = 140; u < 200; ++u) {
    EXPECT_NEAR(corrected.at<float>(88, u), corrector.correct_depth_m(u, 88, 5.0), 1e-5);
  }
}

TEST(DepthCorrector, RectifiesByNearestPixelAndNeverBlendsAcrossAnEdge) {
  RawCamera camera;
  camera.raw = camera.rectified = kCamera;
  camera.distortion = {-0.1, 0.05, 0.001, -0.001, 0.0};
  DepthCorrector corrector{DepthCorrectionConfig{}};
  cv::Mat raw(480, 640, CV_16UC1, cv::Scalar(1000)), corrected;
  raw.colRange(320, 640).setTo(8000);
  ASSERT_TRUE(corrector.correct(raw, camera, &corrected));
  int outside = 0;
  for (int v = 0; v < 480; ++v) {
    for (int u = 0; u < 640; ++u) {
      const float z = corrected.at<float>(v, u);
      outside += std::isnan(z) ? 1 : 0;
      ASSERT_TRUE(std::isnan(z) || z == 1.0f || z == 8.0f) << z;
    }
  }
  EXPECT_LT(outside, 20000);
  // x = (600 - 319.5) / 585 = 0.4795 on the middle row: r2 = 0.2299, factor 1 - 0.02299 + 0.00264 = 0.97965,
  // plus the tangential -0.001 (r2 + 2 x2) = -0.00069: raw column 594 of the right half.
  cv::Mat ramp(480, 640, CV_16UC1);
  for (int v = 0; v < 480; ++v) {
    for (int u = 0; u < 640; ++u) ramp.at<std::uint16_t>(v, u) = static_cast<std::uint16_t>(1000 + u);
  }
  ASSERT_TRUE(corrector.correct(ramp, camera, &corrected));
  EXPECT_NEAR(corrected.at<float>(240, 600), 1.594f, 0.0011f);
}

TEST(DepthCorrector, BothEncodingsGiveTheSameAndInvalidIsNaN) {
  DepthCorrector corrector{DepthCorrectionConfig{}};
  EXPECT_TRUE(corrector.uncalibrated());
  const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  cv::Mat metres = (cv::Mat_<float>(1, 6) << 1.5f, 0.0f, nan, inf, -1.0f, 19.0f);
  cv::Mat millimetres = (cv::Mat_<std::uint16_t>(1, 6) << 1500, 0, 0, 0, 0, 19000);
  const PinholeModel camera = {6, 1, 585.0, 585.0, 3.0, 0.0};
  cv::Mat a, b;
  ASSERT_TRUE(corrector.correct(metres, camera, &a));
  ASSERT_TRUE(corrector.correct(millimetres, camera, &b));
  for (int u = 0; u < 6; ++u) {
    EXPECT_EQ(std::isnan(a.at<float>(0, u)), std::isnan(b.at<float>(0, u))) << u;
    if (std::isnan(a.at<float>(0, u))) continue;
    EXPECT_FLOAT_EQ(a.at<float>(0, u), b.at<float>(0, u));
  }
  EXPECT_TRUE(std::isnan(a.at<float>(0, 3)));
}

TEST(DepthCorrector, SaysWhatIsWrongWithAnImage) {
  DepthCorrector corrector{DepthCorrectionConfig{}};
  cv::Mat out;
  EXPECT_FALSE(corrector.correct(cv::Mat(), kCamera, &out));
  EXPECT_FALSE(corrector.correct(cv::Mat(480, 640, CV_8UC3), kCamera, &out));
  EXPECT_FALSE(corrector.correct(cv::Mat(240, 320, CV_16UC1), kCamera, &out));
  EXPECT_NE(corrector.fault().find("320 x 240"), std::string::npos);
  EXPECT_FALSE(corrector.correct(cv::Mat(480, 640, CV_16UC1), PinholeModel{640, 480, 0, 0, 0, 0}, &out));
  DepthCorrectionConfig missing;
  missing.calibration_file = "/no/such/file.yaml";
  EXPECT_THROW(DepthCorrector{missing}, UserError);
}

}  // namespace
}  // namespace knav
