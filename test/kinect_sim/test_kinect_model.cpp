#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "kinect_sim/kinect_model.h"

namespace knav {
namespace {

const PinholeModel kCamera{640, 480, 585.0, 585.0, 319.5, 239.5};

cv::Mat sense_wall(KinectModel& kinect, double z_m, double tilt_per_px, std::uint64_t frame,
                   float signal = 0.6f) {
  cv::Mat out(480, 640, CV_16UC1);
  std::vector<float> z(640), s(640, signal);
  kinect.start_frame(frame);
  for (int v = 0; v < 480; ++v) {
    for (int u = 0; u < 640; ++u) {
      z[static_cast<std::size_t>(u)] =
          static_cast<float>(z_m * (1.0 + tilt_per_px * (u - 320) + 0.7 * tilt_per_px * (v - 240)));
    }
    kinect.sense_row(v, {z.data(), s.data()}, out.ptr<std::uint16_t>(v));
  }
  return out;
}

struct NoiseFigures {
  double sd, lag1, lag4;
};

/// As the real walls in realdata were measured: 64 x 64 px patches, a quadratic taken off, medians over
/// patches.
NoiseFigures measure(const cv::Mat& depth_mm) {
  std::vector<double> sds, lag1s, lag4s;
  constexpr int kSize = 64;
  for (int y = 0; y + kSize <= 480; y += kSize) {
    for (int x = 0; x + kSize <= 640; x += kSize) {
      Eigen::MatrixXd A(kSize * kSize, 6);
      Eigen::VectorXd codes(kSize * kSize);
      bool complete = true;
      for (int j = 0; j < kSize; ++j) {
        for (int i = 0; i < kSize; ++i) {
          const double a = i / 64.0, b = j / 64.0;
          A.row(j * kSize + i) << 1, a, b, a * b, a * a, b * b;
          const std::uint16_t mm = depth_mm.at<std::uint16_t>(y + j, x + i);
          complete = complete && mm > 0;
          codes[j * kSize + i] = std::round(351000.0 / std::max<double>(mm, 1));
        }
      }
      if (!complete) continue;
      const Eigen::VectorXd solution = (A.transpose() * A).ldlt().solve(A.transpose() * codes);
      const Eigen::VectorXd r = codes - A * solution;
      const double variance = r.squaredNorm() / (kSize * kSize);
      const auto lag = [&](int k) {
        double sum = 0.0;
        for (int j = 0; j < kSize; ++j) {
          for (int i = 0; i + k < kSize; ++i) sum += r[j * kSize + i] * r[j * kSize + i + k];
        }
        return sum / (kSize * (kSize - k)) / variance;
      };
      sds.push_back(std::sqrt(variance));
      lag1s.push_back(lag(1));
      lag4s.push_back(lag(4));
    }
  }
  const auto median = [](std::vector<double>& v) {
    std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
    return v[v.size() / 2];
  };
  if (sds.empty()) return {0, 0, 0};
  return {median(sds), median(lag1s), median(lag4s)};
}

TEST(KinectModel, NoiseHasTheRealWallsDeviationAndCorrelation) {
  KinectConfig config = KinectConfig::preset("default");
  config.dropout_signal = 0.0;
  config.shadow = false;
  config.offset_at_10m = 0.0;
  KinectModel kinect(config, kCamera, 3, 7);
  for (const double z_m : {0.9, 1.3, 1.8}) {
    const NoiseFigures noise = measure(sense_wall(kinect, z_m, 4e-5, static_cast<std::uint64_t>(z_m * 100)));
    // The band of the twelve walls in realdata/kinect_walls, by the same measure.
    EXPECT_GE(noise.sd, 0.47) << z_m;
    EXPECT_LE(noise.sd, 0.62) << z_m;
    EXPECT_NEAR(noise.lag1, 0.665, 0.035) << z_m;
    EXPECT_NEAR(noise.lag4, 0.29, 0.05) << z_m;
  }
}

TEST(KinectModel, BandsAreStepsOfOneCodeThatLieCloserOnFartherWalls) {
  KinectConfig config = KinectConfig::preset("default");
  config.dropout_signal = config.offset_at_10m = 0.0;
  config.noise_codes = 0.5;
  config.shadow = false;
  int last = 0;
  for (const double z_m : {0.6, 1.0, 1.5}) {
    KinectModel kinect(config, kCamera, 3, 7);
    const cv::Mat depth = sense_wall(kinect, z_m, 0.0, 5);
    std::vector<double> column(640, 0.0);  // mean code
    for (int u = 0; u < 640; ++u) {
      for (int v = 0; v < 480; ++v)
        column[static_cast<std::size_t>(u)] += 351000.0 / depth.at<std::uint16_t>(v, u) / 480;
    }
    int steps = 0;
    for (std::size_t u = 1; u < 640; ++u) {
      const double step = column[u] - column[u - 1];
      if (std::abs(step) < 0.4) continue;
      ++steps;
      EXPECT_NEAR(step, -1.0, 0.3) << z_m << " m, column " << u;  // a code less disparity: farther
    }
    // Real walls: 5 and 7 steps at 0.56 and 0.85 m of one device, 11 to 13 at 0.85-1.8 m of the other.
    EXPECT_GT(steps, last) << z_m;
    EXPECT_GE(steps, 4) << z_m;
    EXPECT_LE(steps, 15) << z_m;
    last = steps;
  }
}

TEST(KinectModel, ADeviceOfOneBandStepsInTheMiddleColumnAtEveryDistance) {
  // As the one of realdata/room_sequence. The ramp between is 1.5 codes across the image, at most.
  KinectConfig config = KinectConfig::preset("default");
  config.dropout_signal = config.offset_at_10m = 0.0;
  config.bands = 1.5;
  config.shadow = false;
  KinectModel kinect(config, kCamera, 3, 7);
  for (const double z_m : {0.8, 1.6, 3.5}) {
    const cv::Mat depth = sense_wall(kinect, z_m, 0.0, 5);
    std::vector<double> column(640, 0.0);  // mean code
    for (int u = 0; u < 640; ++u) {
      for (int v = 0; v < 480; ++v)
        column[static_cast<std::size_t>(u)] += 351000.0 / depth.at<std::uint16_t>(v, u) / 480;
    }
    for (std::size_t u = 1; u < 640; ++u) {
      // Of 480 rows' noise some 60 blocks' is independent: a column's mean scatters by 0.06 codes.
      EXPECT_NEAR(column[u] - column[u - 1], u == 321 ? -1.0 : 0.0, 0.25) << z_m << " m, column " << u;
    }
  }
}

TEST(KinectModel, ReadingsAreWholeDisparityCodes) {
  KinectModel kinect(KinectConfig::preset("default"), kCamera, 1, 7);
  const cv::Mat depth = sense_wall(kinect, 4.0, 1e-5, 0);
  for (int u = 0; u < 640; u += 7) {
    const double mm = depth.at<std::uint16_t>(200, u);
    if (mm == 0.0) continue;
    const double code = 351000.0 / mm;
    EXPECT_NEAR(code, std::round(code), 351000.0 / (mm * mm) * 0.51) << "column " << u;
  }
}

TEST(KinectModel, RawDeviceIsTenPercentOffAtTenMetresAndHarshIsWorse) {
  const auto largest_error_at_10m = [](const char* preset) {
    KinectModel kinect(KinectConfig::preset(preset), kCamera, 1, 7);
    double low = 0.0, high = 0.0;
    cv::minMaxIdx(kinect.disparity_offset_px(), &low, &high);
    const double fb = 585.0 * 0.075;
    const double largest = std::max(std::abs(low), high);
    return 1.0 / (1.0 - 10.0 * largest / fb) - 1.0;
  };
  EXPECT_NEAR(largest_error_at_10m("default"), 0.10, 1e-3);
  EXPECT_NEAR(largest_error_at_10m("calibrated"), 0.0125, 1e-3);
  EXPECT_GT(largest_error_at_10m("harsh"), 0.12);
  EXPECT_EQ(largest_error_at_10m("ideal"), 0.0);
}

TEST(KinectModel, TheOffsetLooksLongWhereItIsPositive) {
  KinectConfig config = KinectConfig::preset("default");
  config.noise_codes = 0.29;  // next to none: the rounding itself has that deviation
  config.band_codes = 0.0;
  KinectModel kinect(config, kCamera, 1, 7);
  const cv::Mat depth = sense_wall(kinect, 3.0, 0.0, 0);
  double low = 0.0, high = 0.0;
  cv::Point lowest, highest;
  cv::minMaxLoc(kinect.disparity_offset_px(), &low, &high, &lowest, &highest);
  EXPECT_GT(depth.at<std::uint16_t>(highest), 3000);
  EXPECT_LT(depth.at<std::uint16_t>(lowest), 3000);
}

TEST(KinectModel, NothingNearerThanHalfAMetreAndNothingFromDarkGrazingFarSurfaces) {
  KinectModel kinect(KinectConfig::preset("default"), kCamera, 1, 7);
  EXPECT_EQ(cv::countNonZero(sense_wall(kinect, 0.48, 0.0, 0)), 0);
  EXPECT_EQ(cv::countNonZero(sense_wall(kinect, 45.0, 0.0, 1)), 0);
  EXPECT_EQ(cv::countNonZero(sense_wall(kinect, 8.0, 0.0, 2, 0.005f)), 0);
  EXPECT_GT(cv::countNonZero(sense_wall(kinect, 8.0, 0.0, 3, 0.6f)), 640 * 480 * 99 / 100);
}

TEST(KinectModel, TheShadowFallsToTheLeftOfNearThingsAsWideAsTheDisparitiesDiffer) {
  KinectConfig config = KinectConfig::preset("default");
  config.offset_at_10m = config.band_codes = config.dropout_signal = 0.0;
  config.noise_codes = 0.29;
  KinectModel kinect(config, kCamera, 1, 7);
  std::vector<float> z(640, 4.0f), s(640, 0.6f);
  for (std::size_t u = 300; u < 400; ++u) z[u] = 1.0f;
  std::vector<std::uint16_t> out(640);
  kinect.start_frame(0);
  kinect.sense_row(100, {z.data(), s.data()}, out.data());
  // 43.875 px at 1 m, 10.97 px at 4 m: 33 columns to the left are dark.
  const auto dark = std::count(out.begin(), out.end(), std::uint16_t{0});
  EXPECT_NEAR(static_cast<double>(dark), 33.0, 2.0);
  EXPECT_EQ(out[290], 0);
  EXPECT_NE(out[260], 0);
  EXPECT_NE(out[401], 0);
  EXPECT_NE(out[310], 0);
}

TEST(KinectModel, SameSeedSameBytesOtherSeedOthers) {
  KinectModel a(KinectConfig::preset("harsh"), kCamera, 5, 7),
      b(KinectConfig::preset("harsh"), kCamera, 5, 7), c(KinectConfig::preset("harsh"), kCamera, 6, 7);
  sense_wall(a, 2.0, 0.0, 0);  // what came before does not matter
  const cv::Mat image_a = sense_wall(a, 3.0, 1e-4, 17), image_b = sense_wall(b, 3.0, 1e-4, 17),
                image_c = sense_wall(c, 3.0, 1e-4, 17);
  EXPECT_EQ(cv::countNonZero(image_a != image_b), 0);
  EXPECT_GT(cv::countNonZero(image_a != image_c), 1000);
}

}  // namespace
}  // namespace knav
