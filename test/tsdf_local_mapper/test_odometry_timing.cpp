// Odometry whose stamps are off: that it does not add up along the way, and that views teach how far off they are.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "core/random.h"
#include "tsdf_local_mapper/odometry_timing.h"

namespace knav {
namespace {

constexpr std::size_t kParticles = 4000;
constexpr std::uint64_t kSeed = 5;
constexpr double kFrame_s = 0.2, kSpeed_mps = 0.5;

ParticleSet at_origin() {
  ParticleSet particles;
  particles.resize(kParticles);
  for (std::size_t i = 0; i < kParticles; ++i) particles.set(i, Pose2{});
  particles.weight.assign(kParticles, 1.0 / static_cast<double>(kParticles));
  return particles;
}

void predict(const Pose2& T_step, std::uint64_t step, OdometryTiming* timing, ParticleSet* particles) {
  timing->take_out(particles);
  for (std::size_t i = 0; i < kParticles; ++i) particles->set(i, particles->pose(i) * T_step);
  timing->add(T_step, kFrame_s, kSeed, step, particles);
}

struct Spread {
  double along_m = 0.0, turn_rad = 0.0;
};
Spread spread_of(const ParticleSet& particles) {
  const PoseEstimate estimate = weighted_mean(particles);
  return {std::sqrt(estimate.covariance(0, 0)), std::sqrt(estimate.covariance(2, 2))};
}

TEST(OdometryTiming, WhatOneFrameIsBehindTheNextComesTooFar) {
  OdometryTiming timing({0.03});
  timing.forget(kParticles);
  ParticleSet particles = at_origin();
  for (std::uint64_t step = 0; step < 100; ++step) predict({kFrame_s * kSpeed_mps, 0.0, 0.0}, step, &timing, &particles);
  // By hand: 10 ms, with which it begins, at 0.5 m/s. Added up it would be 50 mm. An sd of n samples is off by 1 / sqrt(2 n), 1.1 %.
  EXPECT_NEAR(spread_of(particles).along_m, 0.01 * kSpeed_mps, 0.045 * 0.01 * kSpeed_mps);
  EXPECT_NEAR(weighted_mean(particles).mean.x_m, 100 * kFrame_s * kSpeed_mps, 1e-3);
}

TEST(OdometryTiming, WhileTheRobotTurnsTheHeadingIsInDoubt) {
  OdometryTiming timing({0.03});
  timing.forget(kParticles);
  ParticleSet particles = at_origin();
  for (std::uint64_t step = 0; step < 30; ++step) predict({0.0, 0.0, kFrame_s * 0.8}, step, &timing, &particles);
  EXPECT_NEAR(spread_of(particles).turn_rad, 0.01 * 0.8, 0.045 * 0.01 * 0.8);
  EXPECT_LT(spread_of(particles).along_m, 1e-9) << "it turns on the spot";
  for (std::uint64_t step = 30; step < 50; ++step) predict({}, step, &timing, &particles);
  EXPECT_LT(spread_of(particles).turn_rad, 1e-6) << "a robot that stands is where it is, whenever that was read";
}

/// Drives on with stamps that are off by `true_sd_s` where views tell the pose to `view_sd_m`. @return what is learned
double learned_sd_s(double true_sd_s, double view_sd_m, int frames) {
  OdometryTiming timing({0.03});
  timing.forget(kParticles);
  ParticleSet particles = at_origin();
  RandomStream random(kSeed, random_stream::kTest, 0, 0);
  double late_before_s = 0.0;
  std::vector<std::uint32_t> parent;
  for (int frame = 1; frame <= frames; ++frame) {
    const double late_s = random.normal(0.0, true_sd_s);
    // Odometry of so much later than the frame.
    predict({kSpeed_mps * (kFrame_s + late_s - late_before_s), 0.0, 0.0}, static_cast<std::uint64_t>(frame), &timing, &particles);
    late_before_s = late_s;
    const double seen_m = kSpeed_mps * kFrame_s * frame + random.normal(0.0, view_sd_m);
    for (std::size_t i = 0; i < kParticles; ++i) {
      particles.weight[i] *= std::exp(-0.5 * std::pow((particles.x_m[i] - seen_m) / view_sd_m, 2));
    }
    EXPECT_TRUE(normalize_weights(particles)) << "frame " << frame;
    timing.learn(particles.weight);
    resample_low_variance(particles, kParticles, random.uniform(), &parent);
    timing.resample(parent);
    // As the motion model's noise does.
    for (double& x_m : particles.x_m) x_m += random.normal(0.0, 0.001);
  }
  return timing.sd_s();
}

TEST(OdometryTiming, ViewsTellHowFarStampsAreOff) {
  // A hundred frames tell an sd to 1 / sqrt(2 x 100) = 7 %; thrice that, and what a frame's own velocity is off by.
  EXPECT_NEAR(learned_sd_s(0.02, 0.002, 400), 0.02, 0.005);
  // Where views tell as little as 4 ms (2 mm at 0.5 m/s), each frame takes away little: it takes longer than for what is there.
  EXPECT_LT(learned_sd_s(0.0, 0.002, 2000), 0.003);
  EXPECT_DOUBLE_EQ(learned_sd_s(0.06, 0.01, 400), 0.03) << "no more than is allowed for";
}

TEST(OdometryTiming, StandingAndBlindFramesTeachNothing) {
  OdometryTiming timing({0.03});
  timing.forget(kParticles);
  ParticleSet particles = at_origin();
  for (std::uint64_t step = 0; step < 50; ++step) {
    predict({}, step, &timing, &particles);
    timing.learn(particles.weight);
  }
  EXPECT_DOUBLE_EQ(timing.sd_s(), 0.01);
  for (std::uint64_t step = 50; step < 350; ++step) {
    predict({kFrame_s * kSpeed_mps, 0.0, 0.0}, step, &timing, &particles);
    timing.learn(particles.weight);
  }
  EXPECT_NEAR(timing.sd_s(), 0.01, 1e-3) << "equal weights return what was assumed, but for their sampling";
}

}  // namespace
}  // namespace knav
