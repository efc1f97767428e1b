// Equation 7, normalised and as printed, against a slow evaluation written out cell by cell.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/random.h"
#include "core/tsdf_alignment.h"

namespace knav {
namespace {

class AlignmentTest : public ::testing::Test {
 protected:
  AlignmentTest() : grid_(config_, 6.0) {
    RangeScan scan;
    scan.angle_min_rad = -0.6;
    scan.angle_increment_rad = 0.004;
    scan.range_max_m = 10.0;
    for (int i = 0; i < 300; ++i) {  // a wall at x = 2 m
      scan.range_m.push_back(static_cast<float>(2.0 / std::cos(-0.6 + i * 0.004)));
    }
    TsdfObservation o;
    observation_from(scan, ObservationLimits{}, &o);
    o.sequence = 1;
    grid_.add(o);
    for (int i = -40; i <= 40; ++i) points_.add(2.0f, 0.01f * static_cast<float>(i), 1.0f);
  }
  float cost_at(const Pose2& pose, float price = 0.6f) {
    ParticleSet particles;
    particles.resize(1);
    particles.set(0, pose);
    std::vector<float> cost;
    tsdf_alignment_costs(grid_, points_, particles, price, &cost);
    return cost[0];
  }
  TsdfConfig config_;
  TsdfGrid grid_;
  WeightedPoints points_;
};

TEST_F(AlignmentTest, ZeroOnTheSurfaceAndLinearAwayFromIt) {
  EXPECT_LT(cost_at({0, 0, 0}), 0.01f);
  // 0.1 m off the wall with mu = base: |F| = 0.1 / mu(2.0 ... 2.2 m).
  const float mu = config_.truncation.at(2.05f, true);
  EXPECT_NEAR(cost_at({-0.1, 0, 0}), 0.1f / mu, 0.02f);
  EXPECT_NEAR(cost_at({0.1, 0, 0}), 0.1f / mu, 0.02f);
}

TEST_F(AlignmentTest, UnknownCellsHaveAPriceAndOffTheGridToo) {
  EXPECT_FLOAT_EQ(cost_at({3.5, 0, 0}, 0.6f), 0.6f);  // behind the wall: never seen
  EXPECT_FLOAT_EQ(cost_at({3.5, 0, 0}, 0.25f), 0.25f);
  EXPECT_FLOAT_EQ(cost_at({100.0, 0, 0}, 0.6f), 0.6f);
  EXPECT_FLOAT_EQ(cost_at({-1e6, 1e6, 2.0}, 0.6f), 0.6f);
}

TEST_F(AlignmentTest, AgreesWithTheWrittenOutSum) {
  RandomStream random(3, random_stream::kTest, 5, 0);
  double bias = 0.0;
  for (int trial = 0; trial < 500; ++trial) {
    const Pose2 pose{random.uniform(-0.6, 0.6), random.uniform(-0.6, 0.6), random.uniform(-0.5, 0.5)};
    double sum = 0.0;
    for (std::size_t k = 0; k < points_.size(); ++k) {
      const Point2 p = pose * Point2{points_.x_m[k], points_.y_m[k]};
      float value = 0.0f;
      const float known = interpolate(grid_, p.x_m, p.y_m, &value);
      sum += std::fabs(value) * known + (1.0f - known) * 0.6f;
    }
    // A reading's place is off by at most 1/256 of a cell either way, and a cost changes by the unknown's price of 0.6
    // from a cell to the next at most (by 0.05 / 0.4 between known ones).
    const double error = cost_at(pose) - sum / static_cast<double>(points_.size());
    EXPECT_LT(std::fabs(error), 2 * 0.6 / 256);
    bias += error / 500;
  }
  EXPECT_LT(std::fabs(bias), 1e-4);
}

TEST_F(AlignmentTest, PlainCodeVectorsAndThreadsGiveTheSameBytes) {
  RandomStream random(3, random_stream::kTest, 6, 0);
  ParticleSet particles;
  particles.resize(500);
  for (std::size_t i = 0; i < 500; ++i) {  // one in five near or over the window's edge
    const double spread_m = i % 5 == 0 ? 40.0 : 0.6;
    particles.set(i, {random.uniform(-spread_m, spread_m), random.uniform(-spread_m, spread_m), random.uniform(-4, 4)});
  }
  std::vector<float> plain, vectors, threads;
  tsdf_alignment_costs(grid_, points_, particles, 0.6f, &plain, 1, false);
  tsdf_alignment_costs(grid_, points_, particles, 0.6f, &vectors, 1, true);
  tsdf_alignment_costs(grid_, points_, particles, 0.6f, &threads, 3);
  EXPECT_EQ(plain, vectors);
  EXPECT_EQ(plain, threads);
}

TEST_F(AlignmentTest, WhatComesNewlyIntoViewHasNoSay) {
  // Half of the hypotheses see the second reading beyond the mapped view, all of them the first, none the
  // third.
  ParticleSet particles;
  particles.resize(4);
  for (std::size_t i = 0; i < 4; ++i) particles.set(i, {0.0, i < 2 ? 0.0 : 2.0, 0.0});
  points_.clear();
  points_.add(2.0f, -1.0f, 1.0f);  // at y = -1 or 1: on the wall's mapped stretch of +-1.37 m
  points_.add(2.0f, 0.5f, 1.0f);   // at y = 0.5 or 2.5
  points_.add(2.0f, 9.0f, 1.0f);
  weigh_by_known_share(grid_, particles, 4, &points_);
  EXPECT_FLOAT_EQ(points_.weight[0], 1.0f);
  EXPECT_FLOAT_EQ(points_.weight[1], 0.25f);
  EXPECT_FLOAT_EQ(points_.weight[2], 0.0f);
}

TEST_F(AlignmentTest, PaperCostIsTheSumOfWeightedDistancesAndUnknownCostsNothing) {
  ParticleSet particles;
  particles.resize(2);
  particles.set(0, {-0.1, 0.0, 0.0});
  particles.set(1, {3.5, 0.0, 0.0});
  std::vector<float> cost;
  float mean_weight = 0.0f;
  tsdf_paper_costs(grid_, points_, particles, &cost, &mean_weight);
  double sum = 0.0;
  for (std::size_t k = 0; k < points_.size(); ++k) {
    const int ix = grid_.cell_of(-0.1 + points_.x_m[k]), iy = grid_.cell_of(points_.y_m[k]);
    sum += std::fabs(static_cast<double>(grid_.distance(ix, iy)) * grid_.weight(ix, iy));
  }
  EXPECT_NEAR(cost[0], sum, 1e-3 * sum);
  EXPECT_EQ(cost[1], 0.0f);  // the paper's weakness: nothing known, nothing to pay
  EXPECT_NEAR(mean_weight, 1.0 / 3.6, 0.05);
}

TEST_F(AlignmentTest, NoReadingsCostNothing) {
  points_.clear();
  EXPECT_EQ(cost_at({0, 0, 0}), 0.0f);
}

}  // namespace
}  // namespace knav
