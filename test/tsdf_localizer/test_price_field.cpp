#include "tsdf_localizer/price_field.h"

#include <gtest/gtest.h>

#include <cmath>

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

double price_at(const PriceField& field, double x_m, double y_m) {
  WeightedPoints point;
  point.add(0.0f, 0.0f, 2.0f);
  ParticleSet one;
  one.resize(1);
  one.set(0, {x_m, y_m, 0.3});
  std::vector<float> price;
  mean_prices(field, point, one, &price);
  return price[0];
}

/// A field, readings and particles, of which some see off the grid.
struct Scene {
  explicit Scene(int readings) {
    grid.width_cells = 40;
    grid.height_cells = 30;
    RandomStream random(1, random_stream::kTest, 0, 0);
    for (int i = 0; i < 40 * 30; ++i) prices.push_back(static_cast<std::uint8_t>(random.uniform(0, 256)));
    field = PriceField(grid, prices, 153);
    for (int i = 0; i < readings; ++i) {
      points.add(static_cast<float>(random.uniform(-15, 15)), static_cast<float>(random.uniform(-15, 15)),
                 static_cast<float>(random.uniform(0.1, 1)));
    }
    particles.resize(5);
    for (std::size_t i = 0; i < 5; ++i) particles.set(i, {random.uniform(0, 15), random.uniform(2, 15), random.uniform(-3, 3)});
  }
  GridGeometry grid = small_grid();
  std::vector<std::uint8_t> prices;
  PriceField field;
  WeightedPoints points;
  ParticleSet particles;
};

TEST(PriceField, InterpolatesBetweenCellCentresAndPricesTheOutside) {
  std::vector<std::uint8_t> prices(20, 102);
  prices[5 + 1] = 0;
  prices[5 + 2] = 255;
  const PriceField field(small_grid(), prices, 51);
  EXPECT_NEAR(field.at(1, 1), 0.0, 1e-9);
  EXPECT_NEAR(field.at(0, 0), 0.4, 1e-9);
  EXPECT_NEAR(field.at(-1, 0), 0.2, 1e-9);
  EXPECT_NEAR(field.at(4, 4), 0.2, 1e-9);
  // centres: cell (1, 1) at (-0.25, 2.75), cell (2, 1) at (0.25, 2.75)
  EXPECT_NEAR(price_at(field, -0.25, 2.75), 0.0, 1e-6);
  EXPECT_NEAR(price_at(field, 0.0, 2.75), 0.5, 1e-6);
  EXPECT_NEAR(price_at(field, 0.125, 2.75), 0.75, 1e-6);
  EXPECT_NEAR(price_at(field, 0.125, 3.0), 0.5 * 0.75 + 0.5 * 0.4, 1e-6);
  EXPECT_NEAR(price_at(field, -1.0, 3.25), 0.5 * 0.4 + 0.5 * 0.2, 1e-6);  // on the grid's edge
  EXPECT_NEAR(price_at(field, -1.25, 3.25), 0.2, 1e-6);
  EXPECT_NEAR(price_at(field, 1.75, 4.25), 0.2, 1e-6);
  EXPECT_NEAR(price_at(field, 1e9, -1e9), 0.2, 1e-6);
  EXPECT_NEAR(price_at(field, -1e9, 1e9), 0.2, 1e-6);
}

TEST(PriceField, AgreesWithASlowSumOverManyReadings) {
  const Scene scene(1000);
  std::vector<float> price;
  mean_prices(scene.field, scene.points, scene.particles, &price);
  for (std::size_t i = 0; i < scene.particles.size(); ++i) {
    double sum = 0.0, weight = 0.0;
    for (std::size_t k = 0; k < scene.points.size(); ++k) {
      const Point2 p = scene.particles.pose(i) * Point2{scene.points.x_m[k], scene.points.y_m[k]};
      const double gx = (p.x_m - scene.grid.origin_x_m) / 0.5 - 0.5, gy = (p.y_m - scene.grid.origin_y_m) / 0.5 - 0.5;
      const int ix = static_cast<int>(std::floor(gx)), iy = static_cast<int>(std::floor(gy));
      const double tx = gx - ix, ty = gy - iy;
      sum += scene.points.weight[k] * ((1 - ty) * ((1 - tx) * scene.field.at(ix, iy) + tx * scene.field.at(ix + 1, iy)) +
                                       ty * ((1 - tx) * scene.field.at(ix, iy + 1) + tx * scene.field.at(ix + 1, iy + 1)));
      weight += scene.points.weight[k];
    }
    // a place is cut to 1/64 cell, by 1/128 on average; neighbours in this field differ by a third
    EXPECT_NEAR(price[i], sum / weight, 2e-3);
  }
}

TEST(PriceField, PlainAndVectorCodeGiveTheSameBytes) {
  for (const int readings : {0, 1, 15, 16, 17, 37, 48, 1000}) {
    const Scene scene(readings);
    std::vector<float> plain, vector;
    mean_prices(scene.field, scene.points, scene.particles, &plain, PriceCode::kPlain);
    for (const PriceCode code : {PriceCode::kBest, PriceCode::kAvx2, PriceCode::kAvx512}) {
      if (!has(code)) continue;
      mean_prices(scene.field, scene.points, scene.particles, &vector, code);
      EXPECT_EQ(plain, vector) << readings;
    }
  }
}

TEST(PriceField, NoReadingsCostNothing) {
  ParticleSet one;
  one.resize(1);
  std::vector<float> price;
  mean_prices(PriceField(small_grid(), std::vector<std::uint8_t>(20, 7), 102), WeightedPoints(), one, &price);
  EXPECT_EQ(price[0], 0.0f);
}

TEST(PriceField, AReadingThatIsNotFiniteIsOutside) {
  WeightedPoints point;
  point.add(NAN, 1.0f, 1.0f);
  ParticleSet one;
  one.resize(1);
  one.set(0, {0.0, 3.0, 0.0});
  std::vector<float> price;
  mean_prices(PriceField(small_grid(), std::vector<std::uint8_t>(20, 0), 255), point, one, &price);
  EXPECT_NEAR(price[0], 1.0, 1e-6);
}

}  // namespace
}  // namespace knav
