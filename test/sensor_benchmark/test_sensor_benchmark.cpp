#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/quantile.h"
#include "core/random.h"
#include "kinect_calib/deband.h"
#include "sensor_benchmark/device_calibration.h"
#include "sensor_benchmark/scene_runner.h"
#include "sensor_benchmark/sections.h"
#include "sensor_benchmark/sensor_statistics.h"

namespace knav {
namespace {

const std::string kWorlds = std::string(KINECT_NAV_SOURCE_DIR) + "/config/worlds";

TEST(Quantile, IsTheNearestRank) {
  EXPECT_EQ(quantile({5, 1, 4, 2, 3}, 0.5), 3);
  EXPECT_EQ(quantile({5, 1, 4, 2, 3}, 0.0), 1);
  EXPECT_EQ(quantile({5, 1, 4, 2, 3}, 1.0), 5);
  EXPECT_TRUE(std::isnan(quantile({}, 0.5)));
}

TEST(SensorBenchmark, KnowsEveryModelOfTheCorrection) {
  const std::vector<std::string> names = depth_model_names();
  EXPECT_NE(std::find(names.begin(), names.end(), "default"), names.end());
  EXPECT_NE(std::find(names.begin(), names.end(), "paper"), names.end());
}

TEST(TrueProfile, IsTheNearestThingBetweenFloorAndTwoMetres) {
  // A wall at 5 m, before its left half a box of 30 cm at 3 m, and a beam at 2.2 m height at 2 m.
  const WorldConfig world = parse_world(
      "name: t\nceiling_m: 0\nspawn: [-3, 0, 0]\nwalls: [{points: [[5.05, -9], [5.05, 9]], height_m: 3}]\n"
      "boxes: [{at: [3.25, 1.0], size: [0.5, 2.0, 0.3]}, {at: [2.1, 0], size: [0.2, 8, 0.3], bottom_m: "
      "2.2}]\n",
      "t");
  SimulatedSensor sensor(world, KinectConfig::preset("ideal"), 1, 1);
  const Eigen::Isometry3d pose = optical_frame(camera_mount({0.0, 0.0, 0.5}, 0.0, 0.0, 0.0));
  cv::Mat depth_m;
  sensor.true_depth(pose, &depth_m);
  std::vector<float> z_m;
  true_profile(depth_m, sensor.camera(), pose, 2.0, &z_m);
  // The box's right edge, y = 0 at 3 m, is the image's middle: column 319.5.
  for (std::size_t u = 0; u < 640; ++u) EXPECT_NEAR(z_m[u], u < 320 ? 3.0f : 5.0f, 1e-3f) << u;
  // Seen tilted, the levelled camera's truth is the same but for the columns that left the view.
  const Eigen::Isometry3d tilted = optical_frame(camera_mount({0.0, 0.0, 0.5}, 0.0, 2.0, 2.0));
  sensor.true_depth(tilted, &depth_m);
  true_profile(depth_m, sensor.camera(), tilted, 2.0, &z_m);
  for (std::size_t u = 20; u < 620; ++u) {
    if (u >= 315 && u <= 325) continue;
    EXPECT_NEAR(z_m[u], u < 320 ? 3.0f : 5.0f, 0.01f) << u;
  }
}

TEST(ReadingsBetween, CountsRowsByHeightAndTellsAShadowFromAThing) {
  // A wall at 2 m, camera 0.5 m up: row v sees it at 0.5 - 2 (v - 239.5) / 585 m, so 0.1 to 0.4 m is 88 rows:
  // 269 to 356. Columns 100 to 109 do not answer.
  cv::Mat depth_m(480, 640, CV_32FC1, cv::Scalar(2.0));
  depth_m.colRange(100, 110).setTo(0.0);
  const Eigen::Isometry3d pose = optical_frame(camera_mount({0.0, 0.0, 0.5}, 0.0, 0.0, 0.0));
  std::vector<int> readings;
  readings_between(depth_m, kinect_camera(), pose, 0.1, 0.4, &readings);
  for (std::size_t u = 0; u < 640; ++u) {
    EXPECT_EQ(readings[u], u >= 100 && u < 110 ? 0 : 88) << u;
  }
}

TEST(SensorStatistics, MeasuresNoiseThatIsKnown) {
  // White noise of 1.2 codes on a wall 2 m off: sd 1.2, no correlation, a level for every code.
  cv::Mat depth_m(480, 640, CV_32FC1);
  RandomStream random(1, random_stream::kTest, 0, 0);
  for (int v = 0; v < 480; ++v) {
    for (int u = 0; u < 640; ++u) {
      const double code = std::round(175.5 + 0.02 * u + 1.1648 * random.normal());  // rounding adds 1/12
      depth_m.at<float>(v, u) = static_cast<float>(351.0 / code);
    }
  }
  SensorStatistics statistics(64, true);
  statistics.add(depth_m, kinect_camera());
  const SensorStatistics::Noise noise = statistics.noise();
  EXPECT_GT(noise.patches, 50);
  EXPECT_NEAR(noise.sd_codes, 1.2, 0.03);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(noise.along_rows[i], 0.0, 0.03);
    EXPECT_NEAR(noise.down_columns[i], 0.0, 0.03);
  }
  EXPECT_NEAR(statistics.levels_per_code(), 1.0, 0.15);
  const SensorStatistics::Valid valid = statistics.valid(2, 0);  // 2 m: from 2 to 4, square on
  EXPECT_GT(statistics.valid(1, 0).tiles + valid.tiles, 100.0);
  EXPECT_EQ(statistics.bands_per_frame(), 0.0);
}

TEST(SensorStatistics, CountsBandsNotTheSmoothPartBetweenThem) {
  // Columns in groups of 80, a code up and a code down in turn: seven steps of one code each.
  cv::Mat depth_m(480, 640, CV_32FC1);
  RandomStream random(2, random_stream::kTest, 0, 0);
  for (int v = 0; v < 480; ++v) {
    for (int u = 0; u < 640; ++u) {
      const double band = (u / 80) % 2 == 0 ? -0.5 : 0.5, bow = 1e-5 * (u - 320) * (u - 320);
      depth_m.at<float>(v, u) =
          static_cast<float>(351.0 / std::round(175.5 + bow + band + 0.5 * random.normal()));
    }
  }
  SensorStatistics statistics(64, true);
  statistics.add(depth_m, kinect_camera());
  EXPECT_EQ(statistics.bands_per_frame(), 7.0);
  EXPECT_NEAR(statistics.band_step_codes(), 1.0, 0.1);
}

/// Turn of a wall about the vertical [deg]: slope of mean inverse depth over x.
double turn_deg(const cv::Mat& depth_m) {
  const PinholeModel camera = kinect_camera();
  double n = 0.0, x_sum = 0.0, xx = 0.0, y_sum = 0.0, xy = 0.0;
  for (int v = 0; v < depth_m.rows; ++v) {
    for (int u = 0; u < depth_m.cols; ++u) {
      const double x = (u - camera.cx_px) / camera.fx_px, y = 1.0 / depth_m.at<float>(v, u);
      if (std::isnan(y)) continue;
      n += 1.0;
      x_sum += x;
      xx += x * x;
      y_sum += y;
      xy += x * y;
    }
  }
  const double slope = (xy - x_sum * y_sum / n) / (xx - x_sum * x_sum / n);
  return std::atan(slope / (y_sum / n)) * 180.0 / M_PI;
}

TEST(Debander, TakesTheSimulatedBandsOutWithoutTurningTheWall) {
  // The bands are a staircase of up to 17 codes across the image, which creeps back between its steps: to
  // take the steps for constant offsets turned a wall at 4 m by many degrees.
  std::size_t steps = 0;
  for (const double distance_m : {0.8, 1.4, 2.5, 4.0}) {
    WallView view(KinectConfig::preset("default"), 5, 103);
    cv::Mat depth_m;
    view.sense(distance_m, 0.02, 0.0, &depth_m);
    const double before_deg = turn_deg(depth_m);
    Debander debander;
    debander.remove_bands(&depth_m);
    steps += debander.steps().size();
    EXPECT_NEAR(turn_deg(depth_m), before_deg, 0.1) << distance_m;
  }
  EXPECT_GT(steps, 20u);
}

/// A short run of the benchmark: what the whole one asks holds for one device too.
class QuickRun : public testing::Test {
 protected:
  QuickRun() : devices_(options_) {}
  static SensorBenchmarkOptions quick() {
    SensorBenchmarkOptions options;
    options.devices = 1;
    options.quick = true;
    options.worlds = kWorlds;
    return options;
  }
  void expect_all() const {
    EXPECT_FALSE(checks_.empty());
    for (const Check& check : checks_) EXPECT_TRUE(check.holds()) << check.name << ": " << check.value;
  }
  SensorBenchmarkOptions options_ = quick();
  Devices devices_;
  std::vector<Check> checks_;
};

TEST_F(QuickRun, CalibrationExtrapolatesToTwentyMetres) {
  measure_calibration(options_, &devices_, &checks_);
  expect_all();
}

TEST_F(QuickRun, EdgesStandUprightWhileTurningAndBetterThanByThePapersShift) {
  const nlohmann::json result = measure_rolling_shutter(options_, &devices_, &checks_);
  expect_all();
  EXPECT_LT(result["default"]["rms_px"].get<double>(), result["paper"]["rms_px"].get<double>());
  EXPECT_GT(result["off"]["rms_px"].get<double>(), 4.0);
}

TEST_F(QuickRun, FloorIsNoObstacleAndObstaclesAreNoFloor) {
  measure_floor(options_, &devices_, &checks_);
  expect_all();
}

TEST_F(QuickRun, ProfileAgreesWithTheNearestObstacle) {
  measure_profile(options_, &devices_, &checks_);
  expect_all();
}

}  // namespace
}  // namespace knav
