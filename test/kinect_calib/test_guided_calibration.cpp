#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/config.h"
#include "test/kinect_calib/wall_robot.h"

namespace knav {
namespace {

using ::testing::HasSubstr;

constexpr double kDegree = kPi / 180.0;

GuidedStart all_clear() {
  GuidedStart start;
  start.behind_is_free = true;
  return start;
}

TEST(GuidedCalibrationConfig, EveryStepIsFiveToFifteenPercentAndTheLastDistanceIsReached) {
  for (double step = 0.05; step <= 0.15; step += 0.01) {
    for (double last_m = 0.9; last_m <= 5.0; last_m += 0.07) {
      GuidedCalibrationConfig config;
      config.step = step;
      config.last_distance_m = last_m;
      ASSERT_TRUE(config.validate().empty());
      double at_m = config.first_distance_m;
      while (const double next_m = config.next_distance_m(at_m)) {
        ASSERT_GE(next_m / at_m, 1.05 - 1e-9) << step << " to " << last_m;
        ASSERT_LE(next_m / at_m, 1.15 + 1e-9) << step << " to " << last_m;
        at_m = next_m;
      }
      EXPECT_GT(at_m * 1.05, last_m);
    }
  }
}

TEST(GuidedCalibrationConfig, AFaultIsASentence) {
  GuidedCalibrationConfig config;
  config.last_distance_m = 0.8;
  config.turn_min_radps = 0.3;
  EXPECT_EQ(config.validate().size(), 2u);
  EXPECT_THROW(read_config<GuidedCalibrationConfig>(YAML::Load("{speed_mps: 0.5}"), "test"), UserError);
}

class FromEightDegreesOff : public ::testing::TestWithParam<double> {};

TEST_P(FromEightDegreesOff, GetsSquareAndBacksOffToFourMetresInEvenSteps) {
  WallRobot robot;
  robot.yaw_rad = GetParam() * kDegree;
  robot.odometry_scale = 1.03;
  const GuidedCalibrationConfig config;
  GuidedRun run(config, all_clear(), &robot);
  EXPECT_EQ(run.guide.total_count(), 22);
  run.run();
  ASSERT_EQ(run.step.state, GuidedState::kDone) << run.step.text;
  ASSERT_NEAR(static_cast<double>(run.finished.size()), 22.0, 1.0);
  EXPECT_NEAR(run.true_m.front(), 0.55, 0.02);
  EXPECT_NEAR(run.true_m.back(), 4.0, 0.1);
  for (std::size_t i = 0; i < run.finished.size(); ++i) {
    EXPECT_EQ(run.kept_at[i], config.frames);
    EXPECT_NEAR(run.finished[i].distance_m, run.true_m[i], 0.004);  // the median of 8 of sd 2 mm
    EXPECT_LT(run.finished[i].sd_m, 0.005);
    EXPECT_LE(std::abs(run.true_off_square_rad[i]), (config.square_within_deg + 0.1) * kDegree)
        << run.true_m[i];
    if (i == 0) continue;
    EXPECT_GE(run.true_m[i] / run.true_m[i - 1], 1.05) << run.true_m[i];
    EXPECT_LE(run.true_m[i] / run.true_m[i - 1], 1.15) << run.true_m[i];
  }
  EXPECT_LE(robot.fastest_mps, config.speed_mps + 1e-9);
  EXPECT_LE(robot.fastest_radps, config.turn_max_radps + 1e-9);
  for (const std::string& notice : run.notices) EXPECT_THAT(notice, HasSubstr("turned to"));
}
INSTANTIATE_TEST_SUITE_P(BothSides, FromEightDegreesOff, ::testing::Values(8.0, -8.0, 18.0));

/// rms over ten runs, at the farthest distance.
double off_square_deg(double slant_per_m, int swing_every) {
  double squares = 0.0;
  constexpr int kRuns = 10;
  for (std::uint32_t seed = 0; seed < kRuns; ++seed) {
    WallRobot robot(seed);
    robot.slant_per_m = slant_per_m;
    robot.finder_left_m = 0.03;
    robot.finder_yaw_rad = 0.5 * kDegree;
    GuidedCalibrationConfig config;
    config.swing_every = swing_every;
    GuidedRun run(config, all_clear(), &robot);
    run.run();
    EXPECT_EQ(run.step.state, GuidedState::kDone) << run.step.text;
    squares += std::pow(run.true_off_square_rad.back() / kDegree, 2);
  }
  return std::sqrt(squares / kRuns);
}

TEST(GuidedCalibration, StandsSquareAlthoughTheDeviceIsSlanted) {
  // At 4 m such a device shows a square wall turned by 0.7 degrees. The finder sits beside the axis, its beam
  // askew.
  for (const double slant_per_m : {0.003, -0.003}) {
    EXPECT_GT(off_square_deg(slant_per_m, 0), 0.6);
    EXPECT_LT(off_square_deg(slant_per_m, 1), 0.3);
  }
}

TEST(GuidedCalibration, AWallThatEndsInViewToTheSidesIsTurnedBackFrom) {
  WallRobot robot;
  GuidedRun run({}, all_clear(), &robot);
  run.run([&] { return run.step.state == GuidedState::kSwing && robot.yaw_rad > 5.0 * kDegree; });
  ASSERT_EQ(run.step.state, GuidedState::kSwing);
  robot.somebody_walks_in = true;
  run.run([&] { return robot.yaw_rad < 2.5 * kDegree; });
  EXPECT_EQ(run.step.state, GuidedState::kSwing);
  robot.somebody_walks_in = false;
  run.run();
  EXPECT_EQ(run.step.state, GuidedState::kDone) << run.step.text;
}

TEST(GuidedCalibration, DrivesUpToTheFirstDistance) {
  WallRobot robot;
  robot.distance_m = 1.0;
  GuidedRun run({}, all_clear(), &robot);
  run.run([&] { return run.finished.size() == 1; });
  EXPECT_NEAR(run.true_m.at(0), 0.55, 0.02);
}

TEST(GuidedCalibration, DoesNotStirUntilSomebodySaysThatTheWayBehindIsFree) {
  WallRobot robot;
  robot.yaw_rad = 0.1;
  GuidedRun run({}, GuidedStart{}, &robot);
  run.run();
  EXPECT_EQ(run.step.state, GuidedState::kFailed);
  EXPECT_THAT(run.step.text, HasSubstr("behind"));
  EXPECT_EQ(robot.fastest_mps + robot.fastest_radps, 0.0);
}

/// Breaks something while the robot backs off: it must be told to stand within the limit, say why, and go on
/// once all is well.
void expect_pause(WallRobot* robot, bool* broken, double limit_s, const std::string& why) {
  GuidedRun run({}, all_clear(), robot);
  run.run([&] { return run.finished.size() == 2 && robot->forward_mps < -0.025; });
  ASSERT_LT(robot->forward_mps, -0.025);
  *broken = true;
  const double since_s = robot->now_s;
  run.run([&] { return run.step.state == GuidedState::kPaused; });
  EXPECT_LE(robot->now_s - since_s, limit_s + 0.05);
  EXPECT_EQ(run.step.forward_mps, 0.0);
  EXPECT_EQ(run.step.turn_radps, 0.0);
  EXPECT_THAT(run.step.text, HasSubstr(why));
  const double later_s = robot->now_s + 10.0;
  run.run([&] {
    EXPECT_EQ(run.step.forward_mps, 0.0);
    return robot->now_s > later_s;
  });
  EXPECT_EQ(run.step.state, GuidedState::kPaused);
  *broken = false;
  run.run();
  EXPECT_EQ(run.step.state, GuidedState::kDone) << run.step.text;
  for (std::size_t i = 1; i < run.true_m.size(); ++i) EXPECT_LE(run.true_m[i] / run.true_m[i - 1], 1.15);
}

TEST(GuidedCalibration, StandsWhileDepthIsStale) {
  WallRobot robot;
  expect_pause(&robot, &robot.silent_depth, 0.5, "depth image");
}

TEST(GuidedCalibration, StandsWhileOdometryIsStale) {
  WallRobot robot;
  expect_pause(&robot, &robot.silent_odometry, 0.5, "odometry");
}

TEST(GuidedCalibration, StandsWhileTheRangeFinderIsSilent) {
  WallRobot robot;
  expect_pause(&robot, &robot.silent_range, 2.0, "range finder");
}

TEST(GuidedCalibration, StandsWhileSomebodyIsBeforeTheWall) {
  WallRobot robot;
  expect_pause(&robot, &robot.somebody_walks_in, 0.15, "no plane");
}

TEST(GuidedCalibration, FramesOfABrokenCollectionAreDropped) {
  WallRobot robot;
  GuidedRun run({}, all_clear(), &robot);
  run.run([&] { return run.kept == 5; });
  robot.somebody_walks_in = true;
  run.run([&] { return run.step.state == GuidedState::kPaused; });
  EXPECT_EQ(run.kept, 0);
  robot.somebody_walks_in = false;
  run.run([&] { return run.finished.size() == 1; });
  EXPECT_EQ(run.kept_at.at(0), 8);
}

TEST(GuidedCalibration, GivesUpWhenTheTroubleLasts) {
  WallRobot robot;
  robot.silent_depth = true;
  GuidedRun run({}, all_clear(), &robot);
  run.run();
  EXPECT_EQ(run.step.state, GuidedState::kFailed);
  EXPECT_NEAR(robot.now_s, 160.0, 1.0);
  EXPECT_THAT(run.step.text, HasSubstr("no depth image"));
}

TEST(GuidedCalibration, StopsWhenTheClockJumpsBack) {
  WallRobot robot;
  GuidedRun run({}, all_clear(), &robot);
  run.run([&] { return run.finished.size() == 1; });
  robot.now_s -= 20.0;
  run.run();
  EXPECT_EQ(run.step.state, GuidedState::kFailed);
  EXPECT_THAT(run.step.text, HasSubstr("clock"));
}

TEST(GuidedCalibration, StopsWhenTheWheelsTurnAndTheWallStays) {
  WallRobot robot;
  GuidedRun run({}, all_clear(), &robot);
  run.run([&] { return run.finished.size() == 12; });
  robot.blocked_behind = true;
  const double at_m = robot.T_odom_base.x_m;
  run.run();
  EXPECT_EQ(run.step.state, GuidedState::kFailed);
  EXPECT_THAT(run.step.text, HasSubstr("slip"));
  EXPECT_LT(std::abs(robot.T_odom_base.x_m - at_m), 0.09);
}

TEST(GuidedCalibration, StopsWhenTheRobotDoesNotMove) {
  WallRobot robot;
  robot.blocked_behind = robot.wheels_stall = true;
  GuidedRun run({}, all_clear(), &robot);
  run.run();
  EXPECT_EQ(run.step.state, GuidedState::kFailed);
  EXPECT_THAT(run.step.text, HasSubstr("not moved"));
}

TEST(GuidedCalibration, StopsWhenItTurnsTheWrongWay) {
  WallRobot robot;
  robot.yaw_rad = 4.0 * kDegree;
  robot.turn_sign = -1.0;
  GuidedRun run({}, all_clear(), &robot);
  run.run();
  EXPECT_EQ(run.step.state, GuidedState::kFailed);
  EXPECT_THAT(run.step.text, HasSubstr("angular.z"));
  EXPECT_LT(robot.yaw_rad, 12.0 * kDegree);
}

TEST(GuidedCalibration, StopsWhenItCannotGetSquare) {
  WallRobot robot;
  robot.yaw_rad = 4.0 * kDegree;
  robot.turn_sign = 0.0;
  GuidedRun run({}, all_clear(), &robot);
  run.run();
  EXPECT_EQ(run.step.state, GuidedState::kFailed);
  EXPECT_THAT(run.step.text, HasSubstr("cannot get square"));
}

TEST(GuidedCalibration, ResumesBehindTheLastFinishedDistance) {
  WallRobot robot;
  GuidedStart start = all_clear();
  start.done_m = {0.55, 0.61, 0.67};
  GuidedRun run({}, start, &robot);
  EXPECT_EQ(run.guide.finished_count(), 3);
  run.run();
  ASSERT_EQ(run.step.state, GuidedState::kDone) << run.step.text;
  EXPECT_NEAR(run.true_m.front(), 0.737, 0.02);
  EXPECT_EQ(run.guide.finished_count(), run.guide.total_count());
  EXPECT_NEAR(run.true_m.back(), 4.0, 0.1);

  start.done_m.push_back(3.95);
  EXPECT_EQ(GuidedCalibration({}, start).step({}).state, GuidedState::kDone);
}

TEST(GuidedCalibration, ARangeFinderThatJumpsIsRefusedByName) {
  WallRobot robot;
  robot.range_jump_m = 0.05;
  GuidedStart start = all_clear();
  start.range_topic = "/laser_pointer";
  GuidedRun run({}, start, &robot);
  run.run();
  EXPECT_EQ(run.step.state, GuidedState::kFailed);
  EXPECT_THAT(run.step.text, HasSubstr("/laser_pointer"));
  EXPECT_THAT(run.step.text, HasSubstr("jumps"));
  EXPECT_EQ(run.notices.size(), 2u);
  EXPECT_TRUE(run.finished.empty());
}

TEST(GuidedCalibration, ARangeFinderThatLooksElsewhereIsRefused) {
  WallRobot robot;
  GuidedStart start = all_clear();
  start.range_offset_m = 0.3;
  GuidedRun run({}, start, &robot);
  run.run();
  EXPECT_EQ(run.step.state, GuidedState::kFailed);
  EXPECT_THAT(run.step.text, HasSubstr("--range-offset"));
}

TEST(GuidedCalibration, AsksForTheDistanceAndDoubtsWhatCannotBe) {
  WallRobot robot;
  robot.silent_range = true;
  GuidedStart start = all_clear();
  start.range_finder = false;
  GuidedRun run({}, start, &robot);
  run.run([&] { return run.step.state == GuidedState::kAsk; });
  ASSERT_EQ(run.step.state, GuidedState::kAsk);
  EXPECT_THAT(run.step.text, HasSubstr("depth says 0.55"));
  run.answer_m = 55.0;  // centimetres
  run.run([&] { return !run.notices.empty(); });
  EXPECT_THAT(run.notices.at(0), HasSubstr("cannot be"));
  EXPECT_TRUE(run.finished.empty());
  run.answer_m = 0.555;
  run.run([&] { return !run.finished.empty(); });
  EXPECT_EQ(run.finished.at(0).readings, 0);
  run.answer_m = 0.0;
  const double later_s = robot.now_s + 5.0;
  run.run([&] { return robot.now_s > later_s && run.step.state == GuidedState::kAsk; });
  robot.T_odom_base.x_m += 0.05;  // somebody pushed it before answering
  run.run([&] { return run.step.state != GuidedState::kAsk; });
  EXPECT_EQ(run.kept, 0);
}

TEST(GuidedCalibration, AFrameThatTheFitRefusesIsMeasuredAgain) {
  WallRobot robot;
  GuidedCalibration guide({}, all_clear());
  GuidedStep step;
  int refused = 0;
  for (int i = 0; i < 20000 && step.state != GuidedState::kFailed; ++i) {
    step = guide.step(robot.tick(step));
    if (step.finished) {
      guide.refuse("no wall.");
      ++refused;
    }
  }
  EXPECT_EQ(refused, 3);
  EXPECT_EQ(step.state, GuidedState::kFailed);
  EXPECT_EQ(guide.finished_count(), 0);
}

}  // namespace
}  // namespace knav
