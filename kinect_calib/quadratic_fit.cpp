#include "kinect_calib/quadratic_fit.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace knav {
namespace {

constexpr double kFarthestReading_m = 26.0, kNearestReading_m = 0.3;
constexpr double kLeastSlope = 0.2;  // guard: corrected depth must rise with raw depth
constexpr double kFar_m = 10.0;      // where neighbours are compared

double huber(double residual) { return std::abs(residual) <= 2.5 ? 1.0 : 2.5 / std::abs(residual); }

struct Reading {
  double raw_m, true_m, weight;
};

Eigen::Vector3d solve(const std::vector<Reading>& readings, const double* held_curvature) {
  Eigen::Vector3d abc(held_curvature != nullptr ? *held_curvature : 0.0, 1.0, 0.0);
  for (int round = 0; round < 3; ++round) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Identity() * 1e-9;
    Eigen::Vector3d b(0.0, 1e-9, 0.0);
    for (const Reading& reading : readings) {
      const double u = reading.raw_m;
      const Eigen::Vector3d terms(u * u, u, 1.0);
      const double residual = reading.true_m - terms.dot(abc);
      const double robust =
          round == 0 ? reading.weight : reading.weight * huber(residual * std::sqrt(reading.weight));
      const Eigen::Vector3d used = held_curvature != nullptr ? Eigen::Vector3d(0.0, u, 1.0) : terms;
      const double known = held_curvature != nullptr ? *held_curvature * u * u : 0.0;
      A += robust * used * used.transpose();
      b += robust * used * (reading.true_m - known);
    }
    abc = A.ldlt().solve(b);
    if (held_curvature != nullptr) abc[0] = *held_curvature;
  }
  return abc;
}

Eigen::Vector3d fit_tile(const std::vector<Reading>& readings, int* held) {
  const Eigen::Vector3d free = solve(readings, nullptr);
  const double far_slope = 2.0 * free[0] * kFarthestReading_m + free[1];
  const double near_slope = 2.0 * free[0] * kNearestReading_m + free[1];
  if (std::min(far_slope, near_slope) >= kLeastSlope && far_slope <= 1.0 / kLeastSlope) return free;
  ++*held;
  const double limit = far_slope < kLeastSlope ? kLeastSlope - 1.0 : 1.0 / kLeastSlope - 1.0;
  const double curvature = limit / (2.0 * kFarthestReading_m);
  return solve(readings, &curvature);
}

template <class Visit>
void around(const TileGrid& grid, int r, int c, const Visit& visit) {
  for (int i = std::max(0, r - 2); i <= std::min(grid.rows - 1, r + 2); ++i) {
    for (int k = std::max(0, c - 2); k <= std::min(grid.columns - 1, c + 2); ++k) {
      if (i != r || k != c) visit(grid.index(i, k));
    }
  }
}

void fill_from_neighbours(const TileGrid& grid, QuadraticField* field) {
  std::vector<char> open = field->filled;
  while (std::count(open.begin(), open.end(), 1) > 0) {
    const std::vector<char> before = open;
    for (int r = 0; r < grid.rows; ++r) {
      for (int c = 0; c < grid.columns; ++c) {
        const std::size_t tile = grid.index(r, c);
        if (before[tile] == 0) continue;
        Eigen::Vector4d sum = Eigen::Vector4d::Zero();
        around(grid, r, c, [&](std::size_t i) {
          if (before[i] == 0) sum += Eigen::Vector4d(field->a_per_m[i], field->b[i], field->c_m[i], 1.0);
        });
        if (sum[3] == 0.0) continue;
        field->a_per_m[tile] = sum[0] / sum[3];
        field->b[tile] = sum[1] / sum[3];
        field->c_m[tile] = sum[2] / sum[3];
        open[tile] = 0;
      }
    }
  }
}

/// Tiles off all their neighbours at kFar_m by six times what neighbours differ.
void find_wild(const TileGrid& grid, QuadraticField* field) {
  const std::vector<char> unmeasured = field->filled;
  const auto at_far = [&](std::size_t i) {
    return (field->a_per_m[i] * kFar_m + field->b[i]) * kFar_m + field->c_m[i];
  };
  std::vector<double> values;
  for (int r = 0; r < grid.rows; ++r) {
    for (int c = 0; c < grid.columns; ++c) {
      const std::size_t tile = grid.index(r, c);
      if (unmeasured[tile] != 0) continue;
      values.clear();
      around(grid, r, c, [&](std::size_t i) {
        if (unmeasured[i] == 0) values.push_back(at_far(i));
      });
      if (values.size() < 5) continue;
      const double median = median_of(&values);
      for (double& value : values) value = std::abs(value - median);
      const double spread = std::max(median_of(&values), 0.01 * kFar_m);
      if (std::abs(at_far(tile) - median) > 6.0 * spread) field->filled[tile] = 1;
    }
  }
}

}  // namespace

QuadraticField fit_quadratics(const TileGrid& grid, double range_finder_sd_m, double sensor_sd_per_m,
                              const std::vector<WallMeasurement>& walls) {
  QuadraticField field;
  std::vector<Reading> readings;
  for (std::size_t tile = 0; tile < grid.count(); ++tile) {
    readings.clear();
    double nearest = 1e9, farthest = 0.0;
    for (const WallMeasurement& wall : walls) {
      if (!wall.has(tile)) continue;
      nearest = std::min(nearest, wall.distance_m);
      farthest = std::max(farthest, wall.distance_m);
      const double d = wall.distance_m;
      // Near walls suffer from the range finder, far ones from the sensor; of inverse depth, turned into
      // depth's.
      const double sd_m = std::hypot(range_finder_sd_m, sensor_sd_per_m * d * d);
      readings.push_back({1.0 / wall.measured_per_m(tile), 1.0 / wall.true_per_m(grid.x[tile], grid.y[tile]),
                          1.0 / (sd_m * sd_m)});
    }
    const bool spans = readings.size() >= 3 && farthest >= kLeastSpan * nearest;
    const Eigen::Vector3d abc = spans ? fit_tile(readings, &field.held) : Eigen::Vector3d(0.0, 1.0, 0.0);
    field.a_per_m.push_back(abc[0]);
    field.b.push_back(abc[1]);
    field.c_m.push_back(abc[2]);
    field.filled.push_back(spans ? 0 : 1);
  }
  if (std::count(field.filled.begin(), field.filled.end(), 0) == 0) {
    throw UserError(
        fmt::format("no tile saw walls at three distances, the farthest {} times the nearest; the walls must "
                    "fill the view.",
                    kLeastSpan));
  }
  find_wild(grid, &field);
  fill_from_neighbours(grid, &field);
  return field;
}

}  // namespace knav
