#include <gtest/gtest.h>

#include <cmath>

#include "core/random.h"
#include "kinect_calib/disparity_fit.h"

namespace knav {
namespace {

const PinholeModel kCamera = {640, 480, 585.0, 585.0, 319.5, 239.5};

/// A sensor that reads 1 / z_raw = (1 / z_true - offset) / (1 + slope).
struct Sensor {
  double offset_per_m = 0.0, slope = 0.0;  // amplitude of rings
  double ring(double x, double y) const { return std::cos(12.0 * std::hypot(x - 0.05, y + 0.03)); }
  double reading_per_m(double true_per_m, double x, double y) const {
    return (true_per_m - offset_per_m * ring(x, y)) / (1.0 + slope * ring(x, y));
  }
};

/// Tile means with white noise of a tenth of a code and a range finder that is wrong by finder_sd_m.
std::vector<WallMeasurement> measure(const Sensor& sensor, const TileGrid& grid, double finder_sd_m,
                                     double farthest_m = 4.0) {
  std::vector<WallMeasurement> walls;
  for (double distance_m = 0.5; distance_m <= farthest_m; distance_m *= 1.12) {
    RandomStream random(3, random_stream::kTest, walls.size(), 0);
    WallMeasurement wall;
    wall.distance_m = distance_m + finder_sd_m * random.normal();
    wall.frames = 1;
    wall.count.assign(grid.count(), 1.0);
    const double tilt_x = 0.005 * random.normal(), tilt_y = 0.02 + 0.005 * random.normal();
    for (std::size_t tile = 0; tile < grid.count(); ++tile) {
      const double truth = (1.0 + tilt_x * grid.x[tile] + tilt_y * grid.y[tile]) / distance_m;
      wall.sum_per_m.push_back(sensor.reading_per_m(truth, grid.x[tile], grid.y[tile]) +
                               3e-4 * random.normal());
    }
    walls.push_back(wall);
  }
  return walls;
}

struct FarBias {
  double mean = 0.0, rms = 0.0;  // of inverse depth [1/m] at 10 m
};
FarBias far_bias(const Sensor& sensor, const TileGrid& grid, const DisparityField& field) {
  FarBias bias;
  for (std::size_t tile = 0; tile < grid.count(); ++tile) {
    const double raw = sensor.reading_per_m(0.1, grid.x[tile], grid.y[tile]);
    const double error = (1.0 + field.total_slope(tile)) * raw + field.total_offset_per_m(tile) - 0.1;
    bias.mean += error / static_cast<double>(grid.count());
    bias.rms += error * error / static_cast<double>(grid.count());
  }
  bias.rms = std::sqrt(bias.rms);
  return bias;
}

TEST(DisparityFit, OffsetsAndSlopesExtrapolateToTenMetres) {
  const TileGrid grid(kCamera, 16);
  for (const Sensor& sensor : {Sensor{0.009, 0.0}, Sensor{0.0, 0.008}, Sensor{0.006, -0.006}}) {
    std::vector<WallMeasurement> walls = measure(sensor, grid, 0.0);
    const FarBias bias = far_bias(sensor, grid, fit_disparity(grid, {}, &walls));
    EXPECT_LE(std::abs(bias.mean), 3e-4) << sensor.offset_per_m;  // 0.3 % at 10 m
    EXPECT_LE(bias.rms, 1e-3) << sensor.offset_per_m;             // 1 %
  }
}

TEST(DisparityFit, NoisyRangesAreFoundOutAndTheScaleStays) {
  const TileGrid grid(kCamera, 16);
  const Sensor sensor = {0.009, 0.006};
  std::vector<WallMeasurement> walls = measure(sensor, grid, 0.002);
  const DisparityField field = fit_disparity(grid, {}, &walls);
  EXPECT_LE(std::abs(field.scale), 0.003);
  EXPECT_LE(std::abs(far_bias(sensor, grid, field).mean), 1e-3);
  // The true distances, of which the range finder was up to 0.8 % off at 0.5 m.
  double before = 0.0, after = 0.0, distance_m = 0.5;
  for (const WallMeasurement& wall : walls) {
    before += std::pow(wall.distance_m / distance_m - 1.0, 2);
    after += std::pow(wall.distance_m / (1.0 + wall.range_error) / distance_m - 1.0, 2);
    distance_m *= 1.12;
  }
  EXPECT_LT(after, 0.5 * before);
}

TEST(DisparityFit, AMountOffSquareIsATiltNotAnErrorOfTheSensor) {
  const TileGrid grid(kCamera, 16);
  std::vector<WallMeasurement> walls = measure({}, grid, 0.0);  // the mount looks 0.02 off along y
  const DisparityField field = fit_disparity(grid, {}, &walls);
  EXPECT_LE(far_bias({}, grid, field).rms, 1.5e-3);
  double tilt_y = 0.0;
  for (const WallMeasurement& wall : walls) tilt_y += wall.tilt_y / static_cast<double>(walls.size());
  EXPECT_NEAR(tilt_y, 0.02, 0.004);
}

TEST(DisparityFit, AWildTileIsReportedAndTakesItsNeighboursError) {
  const TileGrid grid(kCamera, 16);
  const Sensor sensor = {0.009, 0.0};
  std::vector<WallMeasurement> walls = measure(sensor, grid, 0.0);
  const std::size_t wild = grid.index(12, 20);
  for (std::size_t i = 0; i < walls.size(); ++i) walls[i].sum_per_m[wild] += i % 2 == 0 ? 0.03 : -0.02;
  const std::size_t unseen = grid.index(20, 9);
  for (WallMeasurement& wall : walls) wall.sum_per_m[unseen] = wall.count[unseen] = 0.0;
  const DisparityField field = fit_disparity(grid, {}, &walls);
  for (std::size_t tile = 0; tile < grid.count(); ++tile)
    EXPECT_EQ(field.wild[tile], tile == wild ? 1 : 0) << tile;
  for (const std::size_t tile : {wild, unseen}) {
    EXPECT_NEAR(field.total_offset_per_m(tile), 0.009 * sensor.ring(grid.x[tile], grid.y[tile]), 1.5e-3);
    EXPECT_NEAR(field.total_slope(tile), 0.0, 2e-3);
  }
}

TEST(DisparityFit, FineTilesAgreeWithCoarseOnes) {
  const TileGrid coarse(kCamera, 16), fine(kCamera, 8);
  const Sensor sensor = {0.006, -0.006};
  std::vector<WallMeasurement> coarse_walls = measure(sensor, coarse, 0.0);
  const DisparityField start = fit_disparity(coarse, {}, &coarse_walls);
  std::vector<WallMeasurement> walls = measure(sensor, fine, 0.0);
  for (std::size_t i = 0; i < walls.size(); ++i) {
    walls[i].range_error = coarse_walls[i].range_error;
    walls[i].tilt_x = coarse_walls[i].tilt_x;
    walls[i].tilt_y = coarse_walls[i].tilt_y;
  }
  const FarBias bias = far_bias(sensor, fine, refit_disparity(fine, {}, walls, coarse, start));
  EXPECT_LE(std::abs(bias.mean), 3e-4);
  EXPECT_LE(bias.rms, 1e-3);
}

}  // namespace
}  // namespace knav
