#include <gtest/gtest.h>

#include <cmath>

#include "core/cost_field.h"
#include "core/random.h"

namespace knav {
namespace {

GridGeometry small_grid() {
  GridGeometry grid;
  grid.width_cells = 5;
  grid.height_cells = 4;
  grid.resolution_m = 0.5;
  grid.origin_x_m = -1.0;
  grid.origin_y_m = 2.0;
  return grid;
}

double cost_at(const CostField& field, double x_m, double y_m, bool interpolate) {
  WeightedPoints point;
  point.add(0.0f, 0.0f, 2.0f);
  ParticleSet one;
  one.resize(1);
  one.set(0, {x_m, y_m, 0.3});
  std::vector<float> cost;
  alignment_costs(field, point, one, interpolate, &cost);
  return cost[0];
}

TEST(CostField, InterpolatesBetweenCellCentresAndPricesTheOutside) {
  CostField field(small_grid(), 0.4);
  field.set(1, 1, 0.0);
  field.set(2, 1, 1.0);
  EXPECT_NEAR(field.at(1, 1), 0.0, 1e-9);
  EXPECT_NEAR(field.at(0, 0), 0.4, 1e-9);
  EXPECT_NEAR(field.at(-1, 0), 0.4, 1e-9);
  // centres: cell (1, 1) at (-0.25, 2.75), cell (2, 1) at (0.25, 2.75)
  EXPECT_NEAR(cost_at(field, -0.25, 2.75, true), 0.0, 1e-6);
  EXPECT_NEAR(cost_at(field, 0.0, 2.75, true), 0.5, 1e-6);
  EXPECT_NEAR(cost_at(field, 0.125, 2.75, true), 0.75, 1e-6);
  EXPECT_NEAR(cost_at(field, 0.125, 3.0, true), 0.5 * 0.75 + 0.5 * 0.4, 1e-6);
  EXPECT_NEAR(cost_at(field, 0.0, 2.75, false), 1.0, 1e-6);
  EXPECT_NEAR(cost_at(field, -0.01, 2.75, false), 0.0, 1e-6);
  EXPECT_NEAR(cost_at(field, 1.49, 2.1, false), 0.4, 1e-6);
  EXPECT_NEAR(cost_at(field, -7.0, 2.75, true), 0.4, 1e-6);
  EXPECT_NEAR(cost_at(field, 1e9, -1e9, true), 0.4, 1e-6);
}

TEST(CostField, AgreesWithASlowSumOverManyReadings) {
  GridGeometry grid = small_grid();
  grid.width_cells = 40;
  grid.height_cells = 30;
  CostField field(grid, 0.6);
  RandomStream random(1, random_stream::kTest, 0, 0);
  for (int iy = 0; iy < 30; ++iy) {
    for (int ix = 0; ix < 40; ++ix) field.set(ix, iy, random.uniform());
  }
  WeightedPoints points;
  for (int i = 0; i < 37; ++i) {  // not a multiple of the vector's width
    points.add(static_cast<float>(random.uniform(-15, 15)), static_cast<float>(random.uniform(-15, 15)),
               static_cast<float>(random.uniform(0.1, 1)));
  }
  ParticleSet particles;
  particles.resize(3);
  for (std::size_t i = 0; i < 3; ++i)
    particles.set(i, {random.uniform(0, 15), random.uniform(2, 15), random.uniform(-3, 3)});
  std::vector<float> cost;
  alignment_costs(field, points, particles, true, &cost);
  std::vector<float> plain;
  alignment_costs(field, points, particles, true, &plain, false);
  EXPECT_EQ(cost, plain);  // to the bit
  for (std::size_t i = 0; i < 3; ++i) {
    double sum = 0.0, weight = 0.0;
    for (std::size_t k = 0; k < points.size(); ++k) {
      const Point2 p = particles.pose(i) * Point2{points.x_m[k], points.y_m[k]};
      const double gx = (p.x_m - grid.origin_x_m) / 0.5 - 0.5, gy = (p.y_m - grid.origin_y_m) / 0.5 - 0.5;
      const int ix = static_cast<int>(std::floor(gx)), iy = static_cast<int>(std::floor(gy));
      double value = 0.6;
      if (ix >= 0 && iy >= 0 && ix < 39 && iy < 29) {
        const double tx = gx - ix, ty = gy - iy;
        value = (1 - ty) * ((1 - tx) * field.at(ix, iy) + tx * field.at(ix + 1, iy)) +
                ty * ((1 - tx) * field.at(ix, iy + 1) + tx * field.at(ix + 1, iy + 1));
      }
      sum += points.weight[k] * value;
      weight += points.weight[k];
    }
    EXPECT_NEAR(cost[i], sum / weight, 1e-4);
  }
}

TEST(CostField, NoReadingsCostNothing) {
  ParticleSet one;
  one.resize(1);
  std::vector<float> cost;
  alignment_costs(CostField(small_grid(), 0.4), WeightedPoints(), one, true, &cost);
  EXPECT_EQ(cost[0], 0.0f);
}

}  // namespace
}  // namespace knav
