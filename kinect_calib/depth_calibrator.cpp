#include "kinect_calib/depth_calibrator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "kinect_calib/depth_corrector.h"
#include "kinect_calib/quadratic_fit.h"

namespace knav {
namespace {

constexpr std::size_t kFewestWalls = 3;

bool nearer(const WallMeasurement& a, const WallMeasurement& b) { return a.distance_m < b.distance_m; }

}  // namespace

void DepthCalibrator::add_frame(const cv::Mat& depth_m, const PinholeModel& camera, double distance_m) {
  if (!(distance_m > 0.1 && distance_m < 30.0)) {
    throw UserError(fmt::format("distance {} m: must lie between 0.1 and 30 m.", distance_m));
  }
  if (!tiles_) {
    camera_ = camera;
    grid_ = TileGrid(camera, WallTiles::kGateTile_px);
    fine_grid_ = TileGrid(camera, config_.tile_px);
    tiles_ = std::make_unique<WallTiles>(camera);
  }
  if (depth_m.cols != camera_.width_px || depth_m.rows != camera_.height_px) {
    throw UserError(fmt::format("a frame of {} x {} pixels among frames of {} x {}.", depth_m.cols,
                                depth_m.rows, camera_.width_px, camera_.height_px));
  }
  depth_m.copyTo(frame_);
  // The floor before the wall, or what stands beside it, is no wall: its tile learns from other distances.
  const double gate = config_.wall_gate + config_.wall_gate_per_m * distance_m;
  const auto nearest_m = static_cast<float>(distance_m * (1.0 - gate));
  const auto farthest_m = static_cast<float>(distance_m * (1.0 + gate));
  for (int v = 0; v < frame_.rows; ++v) {
    float* row = frame_.ptr<float>(v);
    for (int u = 0; u < frame_.cols; ++u) {
      if (!(row[u] >= nearest_m && row[u] <= farthest_m)) row[u] = std::numeric_limits<float>::quiet_NaN();
    }
  }
  if (config_.deband) debander_.remove_bands(&frame_);
  tiles_->find(frame_, distance_m);
  tiles_->average(frame_, grid_, &per_m_);
  add_to(per_m_, distance_m, &walls_);
  if (config_.tile_px == WallTiles::kGateTile_px) return;
  tiles_->average(frame_, fine_grid_, &per_m_);
  add_to(per_m_, distance_m, &fine_walls_);
}

void DepthCalibrator::add_to(const std::vector<double>& per_m, double distance_m,
                             std::vector<WallMeasurement>* walls) {
  const double same_m = std::max(0.01, 0.005 * distance_m);
  auto wall = std::find_if(walls->begin(), walls->end(), [&](const WallMeasurement& w) {
    return std::abs(w.distance_m - distance_m) <= same_m;
  });
  if (wall == walls->end()) {
    walls->emplace_back();
    wall = walls->end() - 1;
    wall->sum_per_m.assign(per_m.size(), 0.0);
    wall->count.assign(per_m.size(), 0.0);
  }
  for (std::size_t tile = 0; tile < per_m.size(); ++tile) {
    if (std::isnan(per_m[tile])) continue;
    wall->sum_per_m[tile] += per_m[tile];
    wall->count[tile] += 1.0;
  }
  wall->distance_m = (wall->distance_m * wall->frames + distance_m) / (wall->frames + 1);
  ++wall->frames;
}

DisparityPriors DepthCalibrator::priors() const {
  DisparityPriors priors;
  priors.range_finder_sd_m = config_.range_finder_sd_m;
  priors.wall_tilt_sd = config_.wall_tilt_sd;
  if (!config_.fit_wall_tilt) priors.wall_tilt_sd = priors.mount_tilt_sd = 1e-9;
  return priors;
}

DepthCalibration DepthCalibrator::fit() {
  std::sort(walls_.begin(), walls_.end(), nearer);
  std::sort(fine_walls_.begin(), fine_walls_.end(), nearer);
  if (walls_.size() < kFewestWalls || walls_.back().distance_m < kLeastSpan * walls_.front().distance_m) {
    throw UserError(
        fmt::format("{} wall distance{}: calibration needs at least {}, the farthest at least {} times the "
                    "nearest (best 0.5 to 4 m in steps of 5-15 %).",
                    walls_.size(), walls_.size() == 1 ? "" : "s", kFewestWalls, kLeastSpan));
  }
  const bool fine = config_.tile_px != WallTiles::kGateTile_px;
  const TileGrid& grid = fine ? fine_grid_ : grid_;
  const auto fit_field = [&](const DisparityPriors& priors) {
    DisparityField field = fit_disparity(grid_, priors, &walls_);
    if (!fine) return field;
    for (std::size_t i = 0; i < walls_.size(); ++i) {
      fine_walls_[i].range_error = walls_[i].range_error;
      fine_walls_[i].tilt_x = walls_[i].tilt_x;
      fine_walls_[i].tilt_y = walls_[i].tilt_y;
    }
    return refit_disparity(fine_grid_, priors, fine_walls_, grid_, field);
  };
  DisparityPriors offsets_only = priors();
  offsets_only.slopes = false;
  const DisparityField offsets = fit_field(offsets_only);
  const DisparityField field = fit_field(priors());  // last: what it finds of the walls stays
  const std::vector<WallMeasurement>& walls = fine ? fine_walls_ : walls_;
  const double tile_sd_per_m = DisparityPriors().tile_sd_per_m;
  const QuadraticField quadratics = fit_quadratics(grid, config_.range_finder_sd_m, tile_sd_per_m, walls);

  DepthCalibration calibration =
      DepthCalibration::identity(camera_.width_px, camera_.height_px, config_.tile_px);
  calibration.trained_min_m = walls.front().distance_m;
  calibration.trained_max_m = walls.back().distance_m;
  calibration.inverse_depth_scale = offsets.scale;
  wild_tiles_ = filled_tiles_ = 0;
  held_quadratics_ = quadratics.held;
  for (std::size_t tile = 0; tile < grid.count(); ++tile) {
    calibration.inverse_depth_offset_per_m[tile] = offsets.total_offset_per_m(tile);
    calibration.linear_offset_per_m[tile] = field.total_offset_per_m(tile);
    calibration.linear_slope[tile] = field.total_slope(tile);
    double nearest = 1e9, farthest = 0.0;
    for (const WallMeasurement& wall : walls) {
      if (!wall.has(tile)) continue;
      nearest = std::min(nearest, wall.distance_m);
      farthest = std::max(farthest, wall.distance_m);
    }
    const bool filled = farthest < kLeastSpan * nearest || field.wild[tile] != 0;
    calibration.tile_state[tile] = filled ? 1 : 0;
    calibration.tile_trained_max_m[tile] = farthest;
    wild_tiles_ += field.wild[tile];
    filled_tiles_ += filled ? 1 : 0;
  }
  calibration.quadratic_a_per_m = quadratics.a_per_m;
  calibration.quadratic_b = quadratics.b;
  calibration.quadratic_c_m = quadratics.c_m;
  return calibration;
}

std::vector<double> DepthCalibrator::tile_bias(const WallMeasurement& wall,
                                               const DepthCorrector* corrector) const {
  std::vector<double> biases(grid_.count(), std::numeric_limits<double>::quiet_NaN());
  for (int r = 0; r < grid_.rows; ++r) {
    for (int c = 0; c < grid_.columns; ++c) {
      const std::size_t tile = grid_.index(r, c);
      if (!wall.has(tile)) continue;
      const double u = (c + 0.5) * grid_.tile_px - 0.5, v = (r + 0.5) * grid_.tile_px - 0.5;
      const double raw_m = 1.0 / wall.measured_per_m(tile);
      const double depth_m = corrector != nullptr ? corrector->correct_depth_m(u, v, raw_m) : raw_m;
      biases[tile] = depth_m * wall.true_per_m(grid_.x[tile], grid_.y[tile]) - 1.0;
    }
  }
  return biases;
}

std::vector<WallScore> DepthCalibrator::score(const DepthCalibration& calibration) const {
  const auto corrector_of = [&](const char* model) {
    DepthCorrectionConfig config;
    config.model = model;
    return DepthCorrector(config, calibration);
  };
  const DepthCorrector linear = corrector_of("default"), offset = corrector_of("offset"),
                       paper = corrector_of("paper");
  const auto rate = [&](const WallMeasurement& wall, const DepthCorrector* corrector, double* mean,
                        double* p95) {
    std::vector<double> biases = tile_bias(wall, corrector);
    biases.erase(std::remove_if(biases.begin(), biases.end(), [](double b) { return std::isnan(b); }),
                 biases.end());
    for (double& bias : biases) {
      *mean += bias / static_cast<double>(biases.size());
      bias = std::abs(bias);
    }
    std::sort(biases.begin(), biases.end());
    *p95 = biases[static_cast<std::size_t>(0.95 * static_cast<double>(biases.size() - 1))];
  };
  std::vector<WallScore> scores;
  for (const WallMeasurement& wall : walls_) {
    WallScore score;
    score.distance_m = wall.distance_m;
    score.frames = wall.frames;
    rate(wall, nullptr, &score.mean_bias_before, &score.tile_bias_p95_before);
    rate(wall, &linear, &score.mean_bias_after, &score.tile_bias_p95_after);
    rate(wall, &offset, &score.mean_bias_after_offset, &score.tile_bias_p95_after_offset);
    rate(wall, &paper, &score.mean_bias_after_paper, &score.tile_bias_p95_after_paper);
    scores.push_back(score);
  }
  std::sort(scores.begin(), scores.end(),
            [](const WallScore& a, const WallScore& b) { return a.distance_m < b.distance_m; });
  return scores;
}

}  // namespace knav
