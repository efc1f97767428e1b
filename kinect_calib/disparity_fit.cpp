#include "kinect_calib/disparity_fit.h"

#include <Eigen/Sparse>
#include <algorithm>
#include <array>
#include <cmath>

namespace knav {
namespace {

using Index = Eigen::Index;

constexpr double kHuber = 2.5;     // standard deviations
constexpr double kWild = 6.0;      // a tile's typical residual, in standard deviations
constexpr double kNoSlope = 1e-7;  // standard deviation that switches slopes off
constexpr int kRounds = 4;

double square(double value) { return value * value; }
double precision(double sd) { return 1.0 / square(sd); }
double huber(double residual) { return std::abs(residual) <= kHuber ? 1.0 : kHuber / std::abs(residual); }

double tile_variance(const DisparityPriors& priors, const TileGrid& grid, double frames) {
  const double independent = std::max(1.0, grid.tile_px * grid.tile_px / priors.noise_area_px);
  return square(priors.tile_sd_per_m) + square(priors.noise_sd_per_m) / independent / frames;
}

/// A least squares problem by its normal equations.
class Normal {
 public:
  explicit Normal(Index unknowns) : b_(Eigen::VectorXd::Zero(unknowns)) {}

  template <std::size_t N>
  void add(const std::array<Index, N>& columns, const std::array<double, N>& terms, double target,
           double weight) {
    for (std::size_t i = 0; i < N; ++i) {
      b_[columns[i]] += weight * terms[i] * target;
      for (std::size_t k = 0; k < N; ++k)
        triplets_.emplace_back(columns[i], columns[k], weight * terms[i] * terms[k]);
    }
  }
  void prior(Index column, double sd) { triplets_.emplace_back(column, column, precision(sd)); }

  Eigen::SparseMatrix<double> matrix() const {
    Eigen::SparseMatrix<double> A(b_.size(), b_.size());
    A.setFromTriplets(triplets_.begin(), triplets_.end());
    return A;
  }
  const Eigen::VectorXd& right_side() const { return b_; }

 private:
  std::vector<Eigen::Triplet<double>> triplets_;
  Eigen::VectorXd b_;
};

/// The squared second derivatives of a field, as if known independently per 16 x 16 px.
void add_smoothness(const TileGrid& grid, Index first, double curvature_sd, Normal* normal) {
  const double side = grid.tile_px;
  const double weight = square(side / WallTiles::kGateTile_px) * precision(curvature_sd * side * side);
  const auto at = [&](int r, int c) { return first + static_cast<Index>(grid.index(r, c)); };
  for (int r = 0; r < grid.rows; ++r) {
    for (int c = 0; c < grid.columns; ++c) {
      if (c > 0 && c + 1 < grid.columns) {
        normal->add<3>({at(r, c - 1), at(r, c), at(r, c + 1)}, {1.0, -2.0, 1.0}, 0.0, weight);
      }
      if (r > 0 && r + 1 < grid.rows) {
        normal->add<3>({at(r - 1, c), at(r, c), at(r + 1, c)}, {1.0, -2.0, 1.0}, 0.0, weight);
      }
      if (c + 1 < grid.columns && r + 1 < grid.rows) {
        normal->add<4>({at(r, c), at(r, c + 1), at(r + 1, c), at(r + 1, c + 1)}, {1.0, -1.0, -1.0, 1.0}, 0.0,
                       2.0 * weight);
      }
    }
  }
}

void add_field_priors(const TileGrid& grid, const DisparityPriors& priors, Normal* normal) {
  const auto tiles = static_cast<Index>(grid.count());
  // Per area, so that it does not depend on the size of tiles.
  const double share = WallTiles::kGateTile_px / static_cast<double>(grid.tile_px);
  for (Index tile = 0; tile < tiles; ++tile) {
    normal->prior(tile, priors.offset_sd_per_m * share);
    normal->prior(tiles + tile, (priors.slopes ? priors.slope_sd : kNoSlope) * share);
  }
  add_smoothness(grid, 0, priors.offset_curvature_sd_per_m_px2, normal);
  if (priors.slopes) add_smoothness(grid, tiles, priors.slope_curvature_sd_per_px2, normal);
}

/// Takes slopes and offsets from a solution.
void set_field(const Eigen::VectorXd& solution, std::size_t tiles, DisparityField* to) {
  DisparityField& field = *to;
  field.offset_per_m.assign(solution.data(), solution.data() + tiles);
  field.slope.assign(solution.data() + tiles, solution.data() + 2 * tiles);
}

double wall_per_m(const TileGrid& grid, const WallMeasurement& wall, std::size_t tile) {
  return wall.true_per_m(grid.x[tile], grid.y[tile]) + wall.range_error / wall.distance_m;
}

/// What the field and the wall leave unexplained of one reading [1/m].
double residual_per_m(const TileGrid& grid, const DisparityField& field, const WallMeasurement& wall,
                      std::size_t tile) {
  return wall_per_m(grid, wall, tile) - (1.0 + field.total_slope(tile)) * wall.measured_per_m(tile) -
         field.total_offset_per_m(tile);
}

/// What the field and the wall say the sensor should read [1/m]. Slopes multiply this, not the reading, whose
/// noise would pull them towards zero.
double predicted_per_m(const TileGrid& grid, const DisparityField& field, const WallMeasurement& wall,
                       std::size_t tile) {
  return (wall_per_m(grid, wall, tile) - field.total_offset_per_m(tile)) / (1.0 + field.total_slope(tile));
}

/// Tiles of which most readings disagree with every smooth field.
void find_wild(const TileGrid& grid, const DisparityPriors& priors, const std::vector<WallMeasurement>& walls,
               DisparityField* field) {
  std::vector<double> residuals;
  for (std::size_t tile = 0; tile < grid.count(); ++tile) {
    residuals.clear();
    for (const WallMeasurement& wall : walls) {
      if (!wall.has(tile)) continue;
      residuals.push_back(std::abs(residual_per_m(grid, *field, wall, tile)) /
                          std::sqrt(tile_variance(priors, grid, wall.count[tile])));
    }
    if (!residuals.empty() && median_of(&residuals) > kWild) field->wild[tile] = 1;
  }
}

}  // namespace

double interpolate_tiles(const TileGrid& grid, const std::vector<double>& values, double u_px, double v_px) {
  const double column = std::clamp((u_px + 0.5) / grid.tile_px - 0.5, 0.0, grid.columns - 1.0);
  const double row = std::clamp((v_px + 0.5) / grid.tile_px - 0.5, 0.0, grid.rows - 1.0);
  const int c0 = static_cast<int>(column), r0 = static_cast<int>(row);
  const int c1 = std::min(c0 + 1, grid.columns - 1), r1 = std::min(r0 + 1, grid.rows - 1);
  const double s = column - c0, t = row - r0;
  return (1 - t) * ((1 - s) * values[grid.index(r0, c0)] + s * values[grid.index(r0, c1)]) +
         t * ((1 - s) * values[grid.index(r1, c0)] + s * values[grid.index(r1, c1)]);
}

DisparityField fit_disparity(const TileGrid& grid, const DisparityPriors& priors,
                             std::vector<WallMeasurement>* walls) {
  const auto tiles = static_cast<Index>(grid.count());
  const Index scale = 2 * tiles, common = scale + 1, mount_x = scale + 2, mount_y = scale + 3;
  const Index first_wall = scale + 4, unknowns = first_wall + 3 * static_cast<Index>(walls->size());
  DisparityField field;
  field.wild.assign(grid.count(), 0);
  field.slope.assign(grid.count(), 0.0);
  field.offset_per_m.assign(grid.count(), 0.0);
  for (WallMeasurement& wall : *walls) wall.range_error = wall.tilt_x = wall.tilt_y = 0.0;
  for (int round = 0; round < kRounds; ++round) {
    Normal normal(unknowns);
    add_field_priors(grid, priors, &normal);
    normal.prior(scale, priors.scale_sd);
    normal.prior(common, priors.common_offset_sd_per_m);
    normal.prior(mount_x, priors.mount_tilt_sd);
    normal.prior(mount_y, priors.mount_tilt_sd);
    const double gain = 1.0 + field.scale;
    for (std::size_t i = 0; i < walls->size(); ++i) {
      const WallMeasurement& wall = (*walls)[i];
      const Index own = first_wall + 3 * static_cast<Index>(i);
      normal.prior(own, std::hypot(priors.range_finder_sd_m / wall.distance_m,
                                   priors.frame_mean_sd_per_m * wall.distance_m));
      normal.prior(own + 1, priors.wall_tilt_sd);
      normal.prior(own + 2, priors.wall_tilt_sd);
      const double q = 1.0 / wall.distance_m;
      for (Index tile = 0; tile < tiles; ++tile) {
        const auto t = static_cast<std::size_t>(tile);
        if (!wall.has(t) || field.wild[t] != 0) continue;
        const double variance = tile_variance(priors, grid, wall.count[t]);
        const double robust =
            round == 0 ? 1.0 : huber(residual_per_m(grid, field, wall, t) / std::sqrt(variance));
        // Scale times field, linearised about the round before.
        const double predicted = predicted_per_m(grid, field, wall, t);
        const double own_part = field.slope[t] * predicted + field.offset_per_m[t];
        const double x = q * grid.x[t], y = q * grid.y[t];
        normal.add<9>({tile, tiles + tile, scale, common, own, own + 1, own + 2, mount_x, mount_y},
                      {gain, gain * predicted, predicted + own_part, 1.0, -q, -x, -y, -x, -y},
                      q - wall.measured_per_m(t) + field.scale * own_part, robust / variance);
      }
    }
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(normal.matrix());
    const Eigen::VectorXd solution = solver.solve(normal.right_side());
    set_field(solution, grid.count(), &field);
    field.scale = solution[scale];
    field.common_offset_per_m = solution[common];
    for (std::size_t i = 0; i < walls->size(); ++i) {
      const Index own = first_wall + 3 * static_cast<Index>(i);
      WallMeasurement& wall = (*walls)[i];
      wall.range_error = solution[own];
      wall.tilt_x = solution[own + 1] + solution[mount_x];
      wall.tilt_y = solution[own + 2] + solution[mount_y];
    }
    if (round + 2 == kRounds) find_wild(grid, priors, *walls, &field);
  }
  return field;
}

DisparityField refit_disparity(const TileGrid& grid, const DisparityPriors& priors,
                               const std::vector<WallMeasurement>& walls, const TileGrid& start_grid,
                               const DisparityField& start) {
  const auto tiles = static_cast<Index>(grid.count());
  Eigen::VectorXd solution(2 * tiles);
  for (int r = 0; r < grid.rows; ++r) {
    for (int c = 0; c < grid.columns; ++c) {
      const double u = (c + 0.5) * grid.tile_px - 0.5, v = (r + 0.5) * grid.tile_px - 0.5;
      const auto tile = static_cast<Index>(grid.index(r, c));
      solution[tile] = interpolate_tiles(start_grid, start.offset_per_m, u, v);
      solution[tiles + tile] = interpolate_tiles(start_grid, start.slope, u, v);
    }
  }
  DisparityField field = start;
  set_field(solution, grid.count(), &field);
  field.wild.assign(grid.count(), 0);
  find_wild(grid, priors, walls, &field);
  const double gain = 1.0 + field.scale;
  for (int round = 0; round < 2; ++round) {
    Normal normal(2 * tiles);
    add_field_priors(grid, priors, &normal);
    for (const WallMeasurement& wall : walls) {
      for (Index tile = 0; tile < tiles; ++tile) {
        const auto t = static_cast<std::size_t>(tile);
        if (!wall.has(t) || field.wild[t] != 0) continue;
        const double variance = tile_variance(priors, grid, wall.count[t]);
        const double robust = huber(residual_per_m(grid, field, wall, t) / std::sqrt(variance));
        const double target =
            wall_per_m(grid, wall, t) - field.common_offset_per_m - gain * wall.measured_per_m(t);
        normal.add<2>({tile, tiles + tile}, {gain, gain * predicted_per_m(grid, field, wall, t)}, target,
                      robust / variance);
      }
    }
    Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower | Eigen::Upper> solver;
    solver.setTolerance(1e-7);
    solver.setMaxIterations(500);
    const Eigen::SparseMatrix<double> matrix = normal.matrix();  // the solver keeps a reference
    solver.compute(matrix);
    solution = solver.solveWithGuess(normal.right_side(), solution);
    set_field(solution, grid.count(), &field);
  }
  return field;
}

}  // namespace knav
