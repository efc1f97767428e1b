// Everything that a real robot's streams do to the mapper.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "test/tsdf_local_mapper/local_mapper_test.h"
#include "tsdf_local_mapper/local_mapper.h"

namespace knav {
namespace {

TEST_F(LocalMapperTest, DuplicateLateAndOutOfOrderFramesChangeNothing) {
  start();
  drive(30, 0.02, 0.01);
  const LocalMapperResult before = mapper_->result();
  const int observations = before.observations;
  const DepthProfile again = world_.profile(robot_.T_world_base, stamp_s_);
  EXPECT_EQ(mapper_->update(again, kT_base_camera).outcome, FrameOutcome::kDuplicate);
  const DepthProfile late = world_.profile(robot_.T_world_base, stamp_s_ - 0.5 * kFrame_s);
  const LocalMapperResult& refused = mapper_->update(late, kT_base_camera);
  EXPECT_EQ(refused.outcome, FrameOutcome::kOutOfOrder);
  EXPECT_FALSE(refused.accepted);
  EXPECT_FALSE(refused.reason.empty());
  EXPECT_EQ(refused.epoch, before.epoch);
  EXPECT_EQ(mapper_->result().T_local_base.x_m, before.T_local_base.x_m);
  EXPECT_EQ(mapper_->result().observations, observations);
  EXPECT_TRUE(drive(1, 0.02, 0.0).accepted);
}

TEST_F(LocalMapperTest, AFrameNewerThanOdometryWaits) {
  start();
  drive(10, 0.02, 0.0);
  stamp_s_ += 0.5;
  const DepthProfile early = world_.profile(robot_.T_world_base * kT_base_camera, stamp_s_);
  EXPECT_EQ(mapper_->update(early, kT_base_camera).outcome, FrameOutcome::kWaitForOdometry);
  mapper_->add_odometry(stamp_s_, robot_.T_odom_base);
  EXPECT_TRUE(mapper_->update(early, kT_base_camera).accepted);
}

TEST_F(LocalMapperTest, ABackwardClockJumpStartsAnewOnce) {
  start();
  drive(30, 0.02, 0.0);
  stamp_s_ -= 60.0;
  mapper_->add_odometry(stamp_s_, robot_.T_odom_base);
  const LocalMapperResult& first = drive(1, 0.0, 0.0);
  EXPECT_TRUE(first.accepted);
  EXPECT_EQ(first.epoch, 1u);
  EXPECT_EQ(first.epoch_reason, EpochReason::kClockJump);
  EXPECT_NE(first.reason.find("jumped back"), std::string::npos);
  EXPECT_EQ(first.T_local_base.x_m, 0.0);
  const LocalMapperResult& second = drive(1, 0.0, 0.0);
  EXPECT_EQ(second.epoch, 1u);
  EXPECT_TRUE(second.reason.empty());
}

TEST_F(LocalMapperTest, AnOdometryGapAndAJumpStartNewEpochs) {
  start();
  drive(30, 0.02, 0.0);
  stamp_s_ += 3.0;  // silence
  EXPECT_EQ(drive(2, 0.02, 0.0).epoch, 1u);
  EXPECT_EQ(mapper_->result().epoch_reason, EpochReason::kOdometryGap);
  robot_.T_odom_base = Pose2{};  // the base was switched off and on
  EXPECT_EQ(drive(2, 0.02, 0.0).epoch, 2u);
  EXPECT_EQ(mapper_->result().epoch_reason, EpochReason::kOdometryJump);
  EXPECT_EQ(drive(30, 0.02, 0.0).epoch, 2u);
}

TEST_F(LocalMapperTest, ProfilesWithoutReadingsFollowOdometryAndOwnUpToIt) {
  start();
  drive(30, 0.02, 0.0);
  const double sd_before_m = std::sqrt(mapper_->result().covariance(0, 0));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int i = 0; i < 60; ++i) {
    robot_.drive(0.02, 0.0);
    stamp_s_ += kFrame_s;
    mapper_->add_odometry(stamp_s_, robot_.T_odom_base);
    DepthProfile blind = world_.profile(robot_.T_world_base, stamp_s_);
    for (auto* field : {&blind.z_m, &blind.free_from_m, &blind.free_to_m}) {
      field->assign(640, static_cast<float>(nan));
    }
    const LocalMapperResult& result = mapper_->update(blind, kT_base_camera);
    ASSERT_TRUE(result.accepted);
    ASSERT_EQ(result.outcome, FrameOutcome::kNoReadings);
  }
  EXPECT_LT(distance_m(robot_.T_world_base, mapper_->result().T_local_base), 0.25);
  EXPECT_GT(std::sqrt(mapper_->result().covariance(0, 0)), 2.0 * sd_before_m);
  drive(30, 0.0, 0.02);
  EXPECT_LT(std::hypot(error().x_m, error().y_m), 0.10);  // found back to the map
}

TEST_F(LocalMapperTest, NonsenseIsRefusedInWords) {
  start();
  drive(5, 0.02, 0.0);
  DepthProfile profile = world_.profile(robot_.T_world_base, stamp_s_ + 0.01);
  DepthProfile bad = profile;
  bad.z_m.clear();
  EXPECT_EQ(mapper_->update(bad, kT_base_camera).outcome, FrameOutcome::kBadFrame);
  bad = profile;
  bad.fx_px = 0.0;
  EXPECT_EQ(mapper_->update(bad, kT_base_camera).outcome, FrameOutcome::kBadFrame);
  bad = profile;
  bad.stamp_s = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(mapper_->update(bad, kT_base_camera).outcome, FrameOutcome::kBadFrame);
  bad = profile;
  bad.free_to_m.resize(3);
  EXPECT_EQ(mapper_->update(bad, kT_base_camera).outcome, FrameOutcome::kBadFrame);
  EXPECT_EQ(mapper_->update(profile, Pose2{0, 0, std::nan("")}).outcome, FrameOutcome::kBadFrame);
  EXPECT_EQ(mapper_->update(RangeScan{}, kT_base_camera).outcome, FrameOutcome::kBadFrame);
  mapper_->add_odometry(std::nan(""), Pose2{});
  mapper_->add_odometry(stamp_s_ + 0.01, Pose2{std::nan(""), 0, 0});
  EXPECT_TRUE(drive(1, 0.02, 0.0).accepted);
}

TEST_F(LocalMapperTest, ResetStartsANewEpochAtTheOrigin) {
  start();
  drive(30, 0.02, 0.0);
  mapper_->reset();
  const LocalMapperResult& result = drive(1, 0.0, 0.0);
  EXPECT_EQ(result.epoch, 1u);
  EXPECT_EQ(result.epoch_reason, EpochReason::kReset);
  EXPECT_EQ(result.T_local_base.x_m, 0.0);
  EXPECT_EQ(result.observations, 1);
}

}  // namespace
}  // namespace knav
