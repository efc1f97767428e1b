// A depth camera whose columns are steadily wrong: that driving teaches it, and what it must not teach.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "core/error.h"
#include "test/tsdf_local_mapper/room_world.h"
#include "tsdf_local_mapper/local_mapper.h"

namespace knav {
namespace {

constexpr double kFrame_s = 1.0 / 15.0;
constexpr int kBands = 40;
using OffsetOf = std::function<double(double)>;  ///< 1/m, of the place across the image, 0 ... 1

double swinging(double place) { return 0.0008 * std::sin(2.0 * kPi * 3.0 * place); }
double none(double) { return 0.0; }
double everywhere(double) { return 0.0008; }

RoomWorld hall() {
  RoomWorld world;
  world.box(-1.0, -4.0, 13.0, 5.0);
  world.box(5.0, 3.0, 6.0, 5.0);
  world.box(8.0, -4.0, 9.0, -2.5);
  return world;
}

/// Up and down the hall with odometry that is right, so that only the camera is wrong.
RangeOffsets learned_of(const OffsetOf& offset) {
  LocalMapperConfig config;
  config.filter.particles = 200;
  config.range_errors.learn = true;
  config.range_errors.bands = kBands;
  LocalMapper mapper(config);
  const RoomWorld world = hall();
  DrivenRobot robot;
  robot.translation_error = robot.rotation_error = robot.rotation_per_m_rad = 0.0;
  double stamp_s = 0.0;
  const auto drive = [&](int frames, double distance_m, double turn_rad) {
    for (int i = 0; i < frames; ++i) {
      stamp_s += kFrame_s;
      robot.drive(distance_m, turn_rad);
      mapper.add_odometry(stamp_s, robot.T_odom_base);
      DepthProfile profile = world.profile(robot.T_world_base, stamp_s);
      for (std::size_t u = 0; u < profile.z_m.size(); ++u) {
        profile.z_m[u] /= 1.0f - static_cast<float>(offset((static_cast<double>(u) + 0.5) / 640.0)) * profile.z_m[u];
      }
      mapper.update(profile, Pose2{});
    }
  };
  for (int round = 0; round < 4; ++round) {
    drive(200, 0.05, 0.0);
    drive(60, 0.0, kPi / 60.0);
    drive(200, 0.05, 0.0);
    drive(60, 0.0, -kPi / 60.0);
  }
  return mapper.range_offsets();
}

double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

/// Of learned less true offsets, their common part left out.
double rms_left(const std::vector<double>& learned, const OffsetOf& offset) {
  std::vector<double> left;
  for (int band = 0; band < kBands; ++band) {
    left.push_back(learned[static_cast<std::size_t>(band)] - offset((band + 0.5) / kBands));
  }
  const double mean = mean_of(left);
  double sum = 0.0;
  for (const double v : left) sum += (v - mean) * (v - mean);
  return std::sqrt(sum / kBands);
}

class RangeErrorsTest : public ::testing::Test {
 protected:
  void TearDown() override { std::remove(path_.c_str()); }
  std::string path_ = ::testing::TempDir() + "range_errors.yaml";
};

TEST_F(RangeErrorsTest, WhatWasSeenFromAfarAndThenFromNearTeachesThem) {
  // Their own rms is 0.00057. Half of it would be left if every gain were wrong by a factor of two.
  EXPECT_LT(rms_left(learned_of(swinging).offset_per_m, swinging), 0.00028);
}

TEST_F(RangeErrorsTest, ACameraWithoutThemIsLeftAlone) {
  const RangeOffsets learned = learned_of(none);
  // A fifth of what a calibration may leave (offset_sd_per_m, 0.0006), with a margin.
  EXPECT_LT(rms_left(learned.offset_per_m, none), 0.0002);
}

TEST_F(RangeErrorsTest, WhatAllColumnsHaveInCommonIsLeftToTheCalibration) {
  const std::vector<double> learned = learned_of(everywhere).offset_per_m;
  EXPECT_LT(std::fabs(mean_of(learned)), 0.00002);
  EXPECT_LT(rms_left(learned, none), 0.0002);
}

TEST_F(RangeErrorsTest, AScannerIsNotCorrected) {
  LocalMapperConfig config;
  config.range_errors.learn = true;
  LocalMapper mapper(config);
  const RoomWorld world = hall();
  DrivenRobot robot;
  for (int i = 0; i < 400; ++i) {
    robot.drive(0.05, i % 200 == 199 ? kPi : 0.0);
    mapper.add_odometry(0.1 * i, robot.T_odom_base);
    mapper.update(world.scan(robot.T_world_base, 0.1 * i, kPi, 180), Pose2{});
  }
  for (const double offset : mapper.range_offsets().offset_per_m) EXPECT_EQ(offset, 0.0);
}

TEST_F(RangeErrorsTest, TheFileGivesBackWhatWasKeptAlsoForOtherBands) {
  RangeOffsets kept;
  for (int band = 0; band < 20; ++band) {
    kept.offset_per_m.push_back(1e-4 * (band - 9.5));
    kept.sd_per_m.push_back(2e-4);
  }
  kept.save(path_);
  LocalMapperConfig config;
  config.range_errors.learn = true;
  config.range_errors.bands = 40;
  LocalMapper mapper(config);
  mapper.start_from(RangeOffsets::load(path_));
  const RangeOffsets got = mapper.range_offsets();
  ASSERT_EQ(got.offset_per_m.size(), 40u);
  // Band 11 of 40 lies a quarter of the way from the middle of band 5 of 20 to that of band 6... by hand: (11.5 / 40) * 20 - 0.5.
  EXPECT_NEAR(got.offset_per_m[11], 1e-4 * (5.25 - 9.5), 2e-6);
  EXPECT_NEAR(got.sd_per_m[11], 2e-4, 1e-5);  // the mean of all being known makes it a little less
}

TEST_F(RangeErrorsTest, AFileIsNotTakenWhereNothingIsLearned) {
  LocalMapperConfig config;
  config.ros.range_errors_file = path_;
  config.range_errors.learn = false;
  EXPECT_EQ(config.validate().size(), 1u);
  config.range_errors.learn = true;
  EXPECT_TRUE(config.validate().empty());
}

TEST_F(RangeErrorsTest, AFileThatIsNoneIsRefusedByName) {
  for (const char* text : {"", "offset_per_m: 3", "offset_per_m: [0.1, 0.2]\nsd_per_m: [0.001]",
                           "offset_per_m: [.nan, 0]\nsd_per_m: [0.001, 0.001]", "offset_per_m: [0, 0]\nsd_per_m: [0, 1e-4]"}) {
    std::ofstream(path_) << text;
    try {
      RangeOffsets::load(path_);
      FAIL() << text;
    } catch (const UserError& error) {
      EXPECT_NE(std::string(error.what()).find(path_), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace knav
