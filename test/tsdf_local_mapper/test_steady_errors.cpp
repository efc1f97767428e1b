// Odometry that is steadily wrong: how the particles' ideas of it spread, and that choosing among them teaches it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tsdf_local_mapper/steady_errors.h"

namespace knav {
namespace {

constexpr std::size_t kParticles = 4000;

ParticleSet at_origin() {
  ParticleSet particles;
  particles.resize(kParticles);
  for (std::size_t i = 0; i < kParticles; ++i) particles.set(i, Pose2{});
  return particles;
}

/// Drives straight on as the nodelet would: odometry's step, then the errors.
void drive(double distance_m, std::uint64_t* step, SteadyErrors* errors, ParticleSet* particles) {
  constexpr double kStep_m = 0.02;
  for (int k = 0; k < std::lround(distance_m / kStep_m); ++k) {
    for (std::size_t i = 0; i < kParticles; ++i) particles->set(i, particles->pose(i) * Pose2{kStep_m, 0.0, 0.0});
    errors->apply({kStep_m, 0.0, 0.0}, (*step)++, particles);
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

TEST(SteadyErrors, SpreadWithTheDistanceNotWithItsRoot) {
  SteadyErrorsConfig config;
  config.memory_m = 1e6;  // steady
  config.distance_scale_sd = 0.03;
  config.turn_per_m_sd = 0.0;
  SteadyErrors errors(config, 1);
  std::uint64_t step = 0;
  errors.draw(kParticles, step++);
  ParticleSet particles = at_origin();
  drive(2.0, &step, &errors, &particles);
  // An sd estimated from n samples is itself off by a share of 1 / sqrt(2 n), here 1.1 %: four times that.
  EXPECT_NEAR(sd_of(particles.x_m), 0.03 * 2.0, 0.03 * 2.0 * 0.045);
  drive(6.0, &step, &errors, &particles);
  EXPECT_NEAR(sd_of(particles.x_m), 0.03 * 8.0, 0.03 * 8.0 * 0.045);
  EXPECT_NEAR(mean_of(particles.x_m), 8.0, 4.0 * 0.03 * 8.0 / std::sqrt(static_cast<double>(kParticles)));
}

TEST(SteadyErrors, WhatTheViewChoseIsKnownWhereThereIsNoView) {
  // Odometry that reads 4 % short. After 5 m something is in view that tells: those within 2 cm of 5.2 m survive.
  SteadyErrorsConfig config;
  config.memory_m = 100.0;
  config.turn_per_m_sd = 0.0;
  SteadyErrors errors(config, 2);
  std::uint64_t step = 0;
  errors.draw(kParticles, step++);
  ParticleSet particles = at_origin();
  drive(5.0, &step, &errors, &particles);
  std::vector<std::uint32_t> right;
  for (std::size_t i = 0; i < kParticles; ++i) {
    if (std::fabs(particles.x_m[i] - 5.2) < 0.02) right.push_back(static_cast<std::uint32_t>(i));
  }
  ASSERT_GT(right.size(), 50u);
  std::vector<std::uint32_t> parent(kParticles);
  for (std::size_t i = 0; i < kParticles; ++i) parent[i] = right[i % right.size()];
  errors.resample(parent);
  // Then 10 m of corridor in which nothing tells anything.
  particles = at_origin();
  drive(10.0, &step, &errors, &particles);
  EXPECT_NEAR(mean_of(particles.x_m), 10.4, 0.08);  // by the prior alone it would be 10.0
  EXPECT_LT(sd_of(particles.x_m), 0.5 * 0.03 * 10.0);
}

TEST(SteadyErrors, OffTheyChangeNothingAndSameSeedSameBytes) {
  SteadyErrorsConfig off;
  off.memory_m = 0.0;
  SteadyErrors none(off, 3);
  std::uint64_t step = 0;
  none.draw(kParticles, step++);
  ParticleSet particles = at_origin();
  none.apply({0.1, 0.0, 0.2}, step++, &particles);
  EXPECT_EQ(*std::max_element(particles.x_m.begin(), particles.x_m.end()), 0.0);
  ParticleSet first = at_origin(), second = at_origin();
  for (ParticleSet* set : {&first, &second}) {
    SteadyErrorsConfig config;
    config.memory_m = 100.0;
    SteadyErrors errors(config, 4);
    std::uint64_t own = 0;
    errors.draw(kParticles, own++);
    drive(0.5, &own, &errors, set);
  }
  EXPECT_EQ(first.x_m, second.x_m);
  EXPECT_EQ(first.yaw_rad, second.yaw_rad);
}

}  // namespace
}  // namespace knav
