// Odometry that is steadily wrong: how far the particles spread, and that choosing among them teaches it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tsdf_local_mapper/steady_errors.h"

namespace knav {
namespace {

constexpr std::size_t kParticles = 4000;
constexpr double kStep_m = 0.02;
constexpr std::uint64_t kSeed = 5;

ParticleSet at_origin() {
  ParticleSet particles;
  particles.resize(kParticles);
  for (std::size_t i = 0; i < kParticles; ++i) particles.set(i, Pose2{});
  return particles;
}

void drive(double distance_m, const MotionNoise& noise, std::uint64_t* step, SteadyErrors* errors, ParticleSet* particles) {
  for (int k = 0; k < std::lround(distance_m / kStep_m); ++k, *step += 2) {
    errors->move({kStep_m, 0.0, 0.0}, noise, kSeed, *step, 1, particles);
  }
}

double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

double sd_of(const std::vector<double>& values) {
  const double mean = mean_of(values);
  double sum = 0.0;
  for (const double v : values) sum += (v - mean) * (v - mean);
  return std::sqrt(sum / static_cast<double>(values.size()));
}

SteadyErrorsConfig scale_only(double memory_m) {
  SteadyErrorsConfig config;
  config.memory_m = memory_m;
  config.distance_scale_sd = 0.03;
  config.turn_per_m_sd = config.turn_scale_sd = 0.0;
  return config;
}

TEST(SteadyErrors, SpreadWithTheDistanceNotWithItsRoot) {
  SteadyErrors errors(scale_only(1e6));
  errors.forget(kParticles);
  ParticleSet particles = at_origin();
  std::uint64_t step = 0;
  const MotionNoise none{1e-6, 1e-6, 1e-6};
  drive(2.0, none, &step, &errors, &particles);
  // An sd estimated from n samples is itself off by a share of 1 / sqrt(2 n), here 1.1 %: four times that.
  EXPECT_NEAR(sd_of(particles.x_m), 0.03 * 2.0, 0.03 * 2.0 * 0.045);
  drive(6.0, none, &step, &errors, &particles);
  EXPECT_NEAR(sd_of(particles.x_m), 0.03 * 8.0, 0.03 * 8.0 * 0.045);
  EXPECT_NEAR(mean_of(particles.x_m), 8.0, 4.0 * 0.03 * 8.0 / std::sqrt(static_cast<double>(kParticles)));
}

TEST(SteadyErrors, NoiseAndScaleAddUpAsVariances) {
  // By hand: 100 steps of 2 cm with 1 mm of noise each: 10 mm; 3 % of 2 m: 60 mm; together sqrt(10^2 + 60^2) = 60.8 mm.
  SteadyErrors errors(scale_only(1e6));
  errors.forget(kParticles);
  ParticleSet particles = at_origin();
  std::uint64_t step = 0;
  drive(2.0, {0.001, 1e-6, 1e-6}, &step, &errors, &particles);
  EXPECT_NEAR(sd_of(particles.x_m), 0.0608, 0.0608 * 0.045);
  // And what one path tells of the scale, by the rule of one unknown and n equal readings: 1 / (1 / 0.03^2 + 100 (0.02 / 0.001)^2).
  EXPECT_NEAR(errors.sd()[0], std::sqrt(1.0 / (1.0 / (0.03 * 0.03) + 100.0 * 400.0)), 1e-6);
}

TEST(SteadyErrors, WhatTheViewChoseIsKnownWhereThereIsNoView) {
  // Odometry that reads 4 % short. After 5 m something is in view that tells: those within 2 cm of 5.2 m survive.
  SteadyErrors errors(scale_only(1000.0));
  errors.forget(kParticles);
  ParticleSet particles = at_origin();
  std::uint64_t step = 0;
  const MotionNoise noise{0.0005, 0.0005, 1e-6};
  drive(5.0, noise, &step, &errors, &particles);
  std::vector<std::uint32_t> right;
  for (std::size_t i = 0; i < kParticles; ++i) {
    if (std::fabs(particles.x_m[i] - 5.2) < 0.02) right.push_back(static_cast<std::uint32_t>(i));
  }
  ASSERT_GT(right.size(), 50u);
  std::vector<std::uint32_t> parent(kParticles);
  for (std::size_t i = 0; i < kParticles; ++i) parent[i] = right[i % right.size()];
  errors.resample(parent);
  EXPECT_NEAR(errors.mean()[0], 0.04, 0.004);
  // Then 10 m of corridor in which nothing tells anything.
  particles = at_origin();
  drive(10.0, noise, &step, &errors, &particles);
  EXPECT_NEAR(mean_of(particles.x_m), 10.4, 0.08);  // by the prior alone it would be 10.0
  EXPECT_LT(sd_of(particles.x_m), 0.5 * 0.03 * 10.0);
}

TEST(SteadyErrors, TurnsAreToldFromTurningWhileDriving) {
  // Odometry turns 15 % too little, and misses 0.05 rad / m while driving straight. Straight stretches show the one, turns in place
  // the other; after both, each is known. Every step keeps the particle that turned as the robot did, as a sharp view would.
  SteadyErrorsConfig config;
  config.memory_m = 1e6;
  SteadyErrors errors(config);
  errors.forget(kParticles);
  ParticleSet particles = at_origin();
  std::uint64_t step = 0;
  const MotionNoise noise{0.0005, 0.0005, 0.002};
  std::vector<std::uint32_t> parent(kParticles);
  const auto step_and_look = [&](const Pose2& odometry, double true_turn_rad) {
    errors.move(odometry, noise, kSeed, step, 1, &particles);
    step += 2;
    std::size_t best = 0;
    const auto off = [&](std::size_t i) { return std::fabs(particles.yaw_rad[i] - true_turn_rad); };
    for (std::size_t i = 1; i < kParticles; ++i) best = off(i) < off(best) ? i : best;
    std::fill(parent.begin(), parent.end(), static_cast<std::uint32_t>(best));
    errors.resample(parent);
    particles = at_origin();
  };
  for (int k = 0; k < 400; ++k) {
    if ((k / 50) % 2 == 0) {
      step_and_look({0.02, 0.0, 0.0}, 0.05 * 0.02);
    } else {
      step_and_look({0.0, 0.0, 0.02}, 1.15 * 0.02);
    }
  }
  // What remains unknown of each, by the same rule as above from 200 readings of 0.002 / 0.02 = 0.1 (rad / m, and share) each:
  // 1 / sqrt(1 / 0.02^2 + 200 / 0.1^2) and 1 / sqrt(1 / 0.05^2 + 200 / 0.1^2). The prior draws the means to 0 by 11 % and 2 %.
  EXPECT_NEAR(errors.sd()[1], 0.00667, 2e-5);
  EXPECT_NEAR(errors.sd()[2], 0.00700, 2e-5);
  EXPECT_NEAR(errors.mean()[1], 0.05 * 0.889, 3.0 * 0.00667);
  EXPECT_NEAR(errors.mean()[2], 0.15 * 0.980, 3.0 * 0.00700);
}

TEST(SteadyErrors, SameSeedSameBytes) {
  ParticleSet first = at_origin(), second = at_origin();
  for (ParticleSet* set : {&first, &second}) {
    SteadyErrors errors(SteadyErrorsConfig{});
    errors.forget(kParticles);
    std::uint64_t own = 0;
    drive(0.5, {0.001, 0.001, 0.001}, &own, &errors, set);
  }
  EXPECT_EQ(first.x_m, second.x_m);
  EXPECT_EQ(first.yaw_rad, second.yaw_rad);
}

}  // namespace
}  // namespace knav
