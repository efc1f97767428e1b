#include "kinect_calib/depth_calibrator.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "kinect_calib/depth_corrector.h"
#include "kinect_calib/kinect_noise.h"

namespace knav {
namespace {

constexpr double kFarthestReading_m = 26.0;
constexpr double kNearestReading_m = 0.3;
constexpr double kLeastSlope = 0.2;  // guard of the quadratic: corrected depth must rise with raw depth

double median_of(std::vector<double>* values) {
  const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

/// Weight 1 near the model, falling outside k (Huber).
double huber(double residual, double k) { return std::abs(residual) <= k ? 1.0 : k / std::abs(residual); }

}  // namespace

void DepthCalibrator::add_frame(const cv::Mat& depth_m, const PinholeModel& camera, double distance_m) {
  if (!(distance_m > 0.1 && distance_m < 30.0)) {
    throw UserError(fmt::format("distance {} m: must lie between 0.1 and 30 m.", distance_m));
  }
  if (walls_.empty()) {
    camera_ = camera;
    layout_ = DepthCalibration::identity(camera.width_px, camera.height_px, config_.tile_px);
    for (int r = 0; r < layout_.rows(); ++r) {
      for (int c = 0; c < layout_.columns(); ++c) {
        tile_x_.push_back(((c + 0.5) * config_.tile_px - 0.5 - camera.cx_px) / camera.fx_px);
        tile_y_.push_back(((r + 0.5) * config_.tile_px - 0.5 - camera.cy_px) / camera.fy_px);
      }
    }
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

  average_tiles();
  keep_wall_tiles(distance_m);
  const double same_m = std::max(0.01, 0.005 * distance_m);
  auto wall = std::find_if(walls_.begin(), walls_.end(),
                           [&](const Wall& w) { return std::abs(w.distance_m - distance_m) <= same_m; });
  if (wall == walls_.end()) {
    walls_.emplace_back();
    wall = walls_.end() - 1;
    wall->inverse_per_m.assign(layout_.tile_count(), 0.0);
    wall->count.assign(layout_.tile_count(), 0.0);
  }
  for (std::size_t tile = 0; tile < layout_.tile_count(); ++tile) {
    if (std::isnan(frame_per_m_[tile])) continue;
    wall->inverse_per_m[tile] += frame_per_m_[tile];
    wall->count[tile] += 1.0;
  }
  wall->distance_m = (wall->distance_m * wall->frames + distance_m) / (wall->frames + 1);
  ++wall->frames;
}

/// frame_ -> frame_per_m_: each tile's mean inverse depth, NaN where too little answered.
void DepthCalibrator::average_tiles() {
  frame_per_m_.assign(layout_.tile_count(), std::numeric_limits<double>::quiet_NaN());
  std::vector<double> values;
  for (int r = 0; r < layout_.rows(); ++r) {
    for (int c = 0; c < layout_.columns(); ++c) {
      values.clear();
      double half_sum[2] = {0.0, 0.0}, half_count[2] = {0.0, 0.0};
      for (int v = r * config_.tile_px; v < std::min(frame_.rows, (r + 1) * config_.tile_px); ++v) {
        const int half = 2 * (v - r * config_.tile_px) < config_.tile_px ? 0 : 1;
        for (int u = c * config_.tile_px; u < std::min(frame_.cols, (c + 1) * config_.tile_px); ++u) {
          const float z = frame_.at<float>(v, u);
          if (!(z > 0.0f)) continue;
          values.push_back(1.0 / z);
          half_sum[half] += 1.0 / z;
          half_count[half] += 1.0;
        }
      }
      if (values.size() < static_cast<std::size_t>(config_.tile_px * config_.tile_px) / 4 + 1) continue;
      // Floor comes nearer by a code or more with every row; a wall 7 degrees off square, by 0.15.
      if (half_count[0] > 0.0 && half_count[1] > 0.0 &&
          std::abs(half_sum[0] / half_count[0] - half_sum[1] / half_count[1]) >
              0.15 * config_.tile_px * kInverseDepthPerCode) {
        continue;
      }
      // The mean near the median: a median alone would be rounded to a whole code.
      const double median = median_of(&values);
      double sum = 0.0, near = 0.0;
      for (const double value : values) {
        if (std::abs(value - median) > 5.0 * kInverseDepthPerCode) continue;
        sum += value;
        near += 1.0;
      }
      frame_per_m_[static_cast<std::size_t>(r * layout_.columns() + c)] = sum / near;
    }
  }
}

/// Takes out tiles that show floor, ceiling or something else than the wall. UserError if too few are left.
void DepthCalibrator::keep_wall_tiles(double distance_m) {
  Eigen::Vector3d plane(0.0, 0.0, 1.0 / distance_m);  // of inverse depth, in (x, y, 1)
  const auto expected = [&](std::size_t tile) {
    return plane[0] * tile_x_[tile] + plane[1] * tile_y_[tile] + plane[2];
  };
  int kept = 0;
  for (const double tolerance : {0.2, 0.12, 0.08, 0.08}) {
    Eigen::Matrix3d A = Eigen::Matrix3d::Identity() * 1e-9;
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    kept = 0;
    for (std::size_t tile = 0; tile < layout_.tile_count(); ++tile) {
      // What is an error in disparity is a larger share of the inverse depth the farther the wall.
      const double most = tolerance * expected(tile) + 4.0 * kInverseDepthPerCode;
      if (!(std::abs(frame_per_m_[tile] - expected(tile)) <= most)) continue;
      const Eigen::Vector3d terms(tile_x_[tile], tile_y_[tile], 1.0);
      A += terms * terms.transpose();
      b += terms * frame_per_m_[tile];
      ++kept;
    }
    if (kept < static_cast<int>(layout_.tile_count()) * 2 / 5) break;
    plane = A.ldlt().solve(b);
  }
  if (kept < static_cast<int>(layout_.tile_count()) * 2 / 5) {
    throw UserError(
        fmt::format("the frame said to be {:.2f} m from a wall shows one in {} of {} tiles; the wall must "
                    "fill most of the view, at that distance.",
                    distance_m, kept, layout_.tile_count()));
  }
  const double tilt = plane.head<2>().norm() / plane[2];
  if (tilt > 0.12) {
    throw UserError(
        fmt::format("the frame {:.2f} m from a wall is {:.0f} degrees off square; at most 7 will do.",
                    distance_m, std::atan(tilt) * 180.0 / M_PI));
  }
  for (std::size_t tile = 0; tile < layout_.tile_count(); ++tile) {
    const double most = 0.08 * expected(tile) + 4.0 * kInverseDepthPerCode;
    if (!(std::abs(frame_per_m_[tile] - expected(tile)) <= most)) {
      frame_per_m_[tile] = std::numeric_limits<double>::quiet_NaN();
    }
  }
}

double DepthCalibrator::true_per_m(const Wall& wall, std::size_t tile) const {
  return (1.0 + wall.tilt_x * tile_x_[tile] + wall.tilt_y * tile_y_[tile]) / wall.distance_m;
}

/// Of a tile's mean in inverse depth: near walls suffer from the range finder, far ones from the sensor.
double DepthCalibrator::weight(const Wall& wall) const {
  const double finder = config_.range_finder_sd_m / (wall.distance_m * wall.distance_m);
  return 1.0 / (config_.sensor_sd_per_m * config_.sensor_sd_per_m + finder * finder);
}

DepthCalibration DepthCalibrator::fit() {
  std::sort(walls_.begin(), walls_.end(),
            [](const Wall& a, const Wall& b) { return a.distance_m < b.distance_m; });
  if (walls_.size() < 4 || walls_.back().distance_m < 2.0 * walls_.front().distance_m) {
    throw UserError(
        fmt::format("{} wall distance{}: calibration needs at least 4, the farthest at least twice the "
                    "nearest (best 0.5 to 4 m in "
                    "steps of 5-15 %).",
                    walls_.size(), walls_.size() == 1 ? "" : "s"));
  }
  DepthCalibration calibration = layout_;
  offsets_known_ = false;
  calibration.trained_min_m = walls_.front().distance_m;
  calibration.trained_max_m = walls_.back().distance_m;
  for (int round = 0; round < 2; ++round) {
    fit_scale_and_tilts(&calibration);
    fit_offsets(&calibration);
  }
  fit_quadratics(&calibration);
  mend_tiles(&calibration);
  return calibration;
}

void DepthCalibrator::fit_offsets(DepthCalibration* calibration) const {
  std::vector<double> values;
  for (std::size_t tile = 0; tile < calibration->tile_count(); ++tile) {
    // From the median on: a distance at which something else stood before the wall must not drag the rest
    // along.
    values.clear();
    for (const Wall& wall : walls_) {
      if (!wall.has(tile)) continue;
      values.push_back(true_per_m(wall, tile) -
                       (1.0 + calibration->inverse_depth_scale) * wall.measured_per_m(tile));
    }
    double offset = values.empty() ? 0.0 : median_of(&values);
    for (int round = 0; round < 4; ++round) {
      double weights = 0.0, sum = 0.0;
      for (const Wall& wall : walls_) {
        if (!wall.has(tile)) continue;
        const double value =
            true_per_m(wall, tile) - (1.0 + calibration->inverse_depth_scale) * wall.measured_per_m(tile);
        const double robust = huber((value - offset) * std::sqrt(weight(wall)), 2.5);
        const double w = weight(wall) * robust * robust;
        weights += w;
        sum += w * value;
      }
      offset = weights > 0.0 ? sum / weights : 0.0;
    }
    calibration->inverse_depth_offset_per_m[tile] = offset;
  }
}

/// One scale for the whole sensor (focal length and baseline are not exactly nominal; per tile it would take
/// up what little the offsets leave, and extrapolate it) and each wall's tilt, jointly, with the tiles'
/// offsets eliminated: fitted in turns instead, tilts and offsets creep towards each other over hundreds of
/// rounds. Tilts that grow with the distance look exactly like an offset that is linear across the image; so
/// a tilt is one common to all walls (the sensor's mount), free, and a small one of each wall.
void DepthCalibrator::fit_scale_and_tilts(DepthCalibration* calibration) {
  const auto walls = static_cast<Eigen::Index>(walls_.size());
  const Eigen::Index scale = 2 * walls, common_x = scale + 1, common_y = scale + 2, unknowns = scale + 3;
  const auto precision = [](double sd) { return 1.0 / (sd * sd); };
  Eigen::VectorXd prior = Eigen::VectorXd::Constant(unknowns, precision(config_.fit_wall_tilt ? 0.01 : 1e-9));
  prior[scale] = precision(0.01);
  prior[common_x] = prior[common_y] = precision(config_.fit_wall_tilt ? 0.1 : 1e-9);
  Eigen::MatrixXd A = prior.asDiagonal();
  Eigen::VectorXd b = Eigen::VectorXd::Zero(unknowns);
  Eigen::MatrixXd J(walls, unknowns);
  Eigen::VectorXd constant(walls), weights(walls);
  for (std::size_t tile = 0; tile < calibration->tile_count(); ++tile) {
    J.setZero();
    constant.setZero();
    weights.setZero();
    for (Eigen::Index i = 0; i < walls; ++i) {
      const Wall& wall = walls_[static_cast<std::size_t>(i)];
      if (!wall.has(tile)) continue;
      const double measured = wall.measured_per_m(tile);
      J(i, 2 * i) = J(i, common_x) = tile_x_[tile] / wall.distance_m;
      J(i, 2 * i + 1) = J(i, common_y) = tile_y_[tile] / wall.distance_m;
      J(i, scale) = -measured;
      constant[i] = 1.0 / wall.distance_m - measured;
      const double residual = true_per_m(wall, tile) - (1.0 + calibration->inverse_depth_scale) * measured -
                              calibration->inverse_depth_offset_per_m[tile];
      weights[i] = weight(wall) * (offsets_known_ ? huber(residual * std::sqrt(weight(wall)), 2.5) : 1.0);
    }
    const double total = weights.sum();
    if (total <= 0.0) continue;
    const Eigen::RowVectorXd mean = weights.transpose() * J / total;
    J.rowwise() -= mean;
    constant.array() -= weights.dot(constant) / total;
    A += J.transpose() * weights.asDiagonal() * J;
    b -= J.transpose() * weights.asDiagonal() * constant;
  }
  const Eigen::VectorXd solution = A.ldlt().solve(b);
  for (Eigen::Index i = 0; i < walls; ++i) {
    Wall& wall = walls_[static_cast<std::size_t>(i)];
    wall.tilt_x = std::clamp(solution[2 * i] + solution[common_x], -0.2, 0.2);
    wall.tilt_y = std::clamp(solution[2 * i + 1] + solution[common_y], -0.2, 0.2);
  }
  calibration->inverse_depth_scale = std::clamp(solution[scale], -0.1, 0.1);
  offsets_known_ = true;
}

void DepthCalibrator::fit_quadratics(DepthCalibration* calibration) const {
  for (std::size_t tile = 0; tile < calibration->tile_count(); ++tile) {
    Eigen::Vector3d abc(0.0, 1.0, 0.0);
    // Free, then, if it would bend back between 0.3 and 26 m, with its curvature held at the limit.
    for (const bool held : {false, true}) {
      if (held) {
        const double far_slope = 2.0 * abc[0] * kFarthestReading_m + abc[1];
        const double near_slope = 2.0 * abc[0] * kNearestReading_m + abc[1];
        if (std::min(far_slope, near_slope) >= kLeastSlope && far_slope <= 1.0 / kLeastSlope) break;
        abc[0] = far_slope < kLeastSlope ? (kLeastSlope - 1.0) / (2.0 * kFarthestReading_m)
                                         : (1.0 / kLeastSlope - 1.0) / (2.0 * kFarthestReading_m);
      }
      for (int round = 0; round < 3; ++round) {
        Eigen::Matrix3d A = Eigen::Matrix3d::Identity() * 1e-9;
        Eigen::Vector3d b = Eigen::Vector3d(0.0, 1e-9, 0.0);
        for (const Wall& wall : walls_) {
          if (!wall.has(tile)) continue;
          const double u = 1.0 / wall.measured_per_m(tile), d = 1.0 / true_per_m(wall, tile);
          const double w = weight(wall) / std::pow(d, 4);  // of inverse depth, turned into depth's
          const Eigen::Vector3d terms(u * u, u, 1.0);
          const double residual = d - terms.dot(abc);
          const double robust = round == 0 ? w : w * huber(residual * std::sqrt(w), 2.5);
          const Eigen::Vector3d known =
              held ? Eigen::Vector3d(abc[0] * u * u, 0, 0) : Eigen::Vector3d::Zero();
          const Eigen::Vector3d used = held ? Eigen::Vector3d(0.0, u, 1.0) : terms;
          A += robust * used * used.transpose();
          b += robust * used * (d - known[0]);
        }
        const double curvature = abc[0];
        abc = A.ldlt().solve(b);
        if (held) abc[0] = curvature;
      }
    }
    calibration->quadratic_a_per_m[tile] = abc[0];
    calibration->quadratic_b[tile] = abc[1];
    calibration->quadratic_c_m[tile] = abc[2];
  }
}

/// Tiles with too few walls, or far off all their neighbours, take their neighbours' mean.
void DepthCalibrator::mend_tiles(DepthCalibration* calibration) {
  const int rows = calibration->rows(), columns = calibration->columns();
  std::vector<double>& offset = calibration->inverse_depth_offset_per_m;
  const auto around = [&](int r, int c, const auto& visit) {
    for (int i = std::max(0, r - 2); i <= std::min(rows - 1, r + 2); ++i) {
      for (int k = std::max(0, c - 2); k <= std::min(columns - 1, c + 2); ++k) {
        if (i != r || k != c) visit(static_cast<std::size_t>(i * columns + k));
      }
    }
  };
  for (std::size_t tile = 0; tile < calibration->tile_count(); ++tile) {
    double nearest = 1e9, farthest = 0.0;
    for (const Wall& wall : walls_) {
      if (!wall.has(tile)) continue;
      nearest = std::min(nearest, wall.distance_m);
      farthest = std::max(farthest, wall.distance_m);
    }
    calibration->tile_state[tile] = farthest >= 2.0 * nearest ? 0 : 1;
  }
  const std::vector<int> measured = calibration->tile_state;
  std::vector<double> values;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const auto tile = static_cast<std::size_t>(r * columns + c);
      if (measured[tile] != 0) continue;
      values.clear();
      around(r, c, [&](std::size_t i) {
        if (measured[i] == 0) values.push_back(offset[i]);
      });
      if (values.size() < 5) continue;
      const double median = median_of(&values);
      for (double& value : values) value = std::abs(value - median);
      const double spread = std::max(median_of(&values), config_.sensor_sd_per_m);
      if (std::abs(offset[tile] - median) > 6.0 * spread) calibration->tile_state[tile] = 1;
    }
  }
  filled_tiles_ =
      static_cast<int>(std::count(calibration->tile_state.begin(), calibration->tile_state.end(), 1));
  if (filled_tiles_ == static_cast<int>(calibration->tile_count())) {
    throw UserError("no tile saw walls at distances a factor 2 apart; the walls must fill the view.");
  }
  std::vector<int> open = calibration->tile_state;
  while (std::count(open.begin(), open.end(), 1) > 0) {
    const std::vector<int> before = open;
    for (int r = 0; r < rows; ++r) {
      for (int c = 0; c < columns; ++c) {
        const auto tile = static_cast<std::size_t>(r * columns + c);
        if (before[tile] == 0) continue;
        double n = 0.0, o = 0.0, qa = 0.0, qb = 0.0, qc = 0.0;
        around(r, c, [&](std::size_t i) {
          if (before[i] != 0) return;
          n += 1.0;
          o += offset[i];
          qa += calibration->quadratic_a_per_m[i];
          qb += calibration->quadratic_b[i];
          qc += calibration->quadratic_c_m[i];
        });
        if (n == 0.0) continue;
        offset[tile] = o / n;
        calibration->quadratic_a_per_m[tile] = qa / n;
        calibration->quadratic_b[tile] = qb / n;
        calibration->quadratic_c_m[tile] = qc / n;
        open[tile] = 0;
      }
    }
  }
}

std::vector<WallScore> DepthCalibrator::score(const DepthCalibration& calibration) const {
  DepthCorrectionConfig by_default, by_paper;
  by_paper.model = "paper";
  const DepthCorrector corrector(by_default, calibration), paper(by_paper, calibration);
  std::vector<WallScore> scores;
  std::vector<double> biases;
  for (const Wall& wall : walls_) {
    WallScore score;
    score.distance_m = wall.distance_m;
    score.frames = wall.frames;
    const auto rate = [&](const auto& corrected, double* mean, double* p95) {
      biases.clear();
      *mean = 0.0;
      for (std::size_t tile = 0; tile < layout_.tile_count(); ++tile) {
        if (!wall.has(tile)) continue;
        const auto column = static_cast<double>(tile % static_cast<std::size_t>(layout_.columns()));
        const auto row = static_cast<double>(tile / static_cast<std::size_t>(layout_.columns()));
        const double u = (column + 0.5) * layout_.tile_px - 0.5, v = (row + 0.5) * layout_.tile_px - 0.5;
        const double bias = corrected(u, v, 1.0 / wall.measured_per_m(tile)) * true_per_m(wall, tile) - 1.0;
        *mean += bias;
        biases.push_back(std::abs(bias));
      }
      *mean /= static_cast<double>(biases.size());
      std::sort(biases.begin(), biases.end());
      *p95 = biases[static_cast<std::size_t>(0.95 * static_cast<double>(biases.size() - 1))];
    };
    rate([](double, double, double z) { return z; }, &score.mean_bias_before, &score.tile_bias_p95_before);
    rate([&](double u, double v, double z) { return corrector.correct_depth_m(u, v, z); },
         &score.mean_bias_after, &score.tile_bias_p95_after);
    rate([&](double u, double v, double z) { return paper.correct_depth_m(u, v, z); },
         &score.mean_bias_after_paper, &score.tile_bias_p95_after_paper);
    scores.push_back(score);
  }
  std::sort(scores.begin(), scores.end(),
            [](const WallScore& a, const WallScore& b) { return a.distance_m < b.distance_m; });
  return scores;
}

}  // namespace knav
