#include "sensor_benchmark/sensor_statistics.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/pose2.h"
#include "core/quantile.h"
#include "kinect_calib/deband.h"
#include "kinect_calib/kinect_noise.h"

namespace knav {
namespace {

constexpr int kBorder_px = 16;  // a real Kinect's last columns never answer
constexpr int kTile_px = 16;
constexpr double kFlat_codes = 1.5;   ///< rms about a surface above which a piece is not flat
constexpr double kPlane_codes = 0.8;  ///< rms about a plane above which a patch's surroundings are no plane
constexpr double kPatchFill = 0.98;   ///< of its pixels must answer
constexpr double kTileFill = 0.3;

/// Least squares fit of a surface with the given terms to the readings of a window; residuals, NaN where
/// none.
template <int Terms, class TermsOf>
bool fit_surface(const cv::Mat& codes, double least_fill, const TermsOf& terms_of,
                 Eigen::Matrix<double, Terms, 1>* surface, cv::Mat* residual, double* fill) {
  Eigen::Matrix<double, Terms, Terms> A = Eigen::Matrix<double, Terms, Terms>::Identity() * 1e-9;
  Eigen::Matrix<double, Terms, 1> b = Eigen::Matrix<double, Terms, 1>::Zero();
  int count = 0;
  for (int v = 0; v < codes.rows; ++v) {
    for (int u = 0; u < codes.cols; ++u) {
      const float code = codes.at<float>(v, u);
      if (std::isnan(code)) continue;
      const Eigen::Matrix<double, Terms, 1> terms = terms_of(u, v);
      A += terms * terms.transpose();
      b += terms * static_cast<double>(code);
      ++count;
    }
  }
  *fill = static_cast<double>(count) / (codes.rows * codes.cols);
  if (*fill < least_fill) return false;
  *surface = A.ldlt().solve(b);
  residual->create(codes.rows, codes.cols, CV_32FC1);
  for (int v = 0; v < codes.rows; ++v) {
    for (int u = 0; u < codes.cols; ++u) {
      residual->at<float>(v, u) = codes.at<float>(v, u) - static_cast<float>(surface->dot(terms_of(u, v)));
    }
  }
  return true;
}

Eigen::Matrix<double, 6, 1> quadratic_terms(double u, double v) {
  const double a = u / 64.0, b = v / 64.0;
  Eigen::Matrix<double, 6, 1> terms;
  terms << 1.0, a, b, a * b, a * a, b * b;
  return terms;
}

double rms(const cv::Mat& residual) {
  double sum = 0.0, count = 0.0;
  for (int v = 0; v < residual.rows; ++v) {
    for (int u = 0; u < residual.cols; ++u) {
      const double r = residual.at<float>(v, u);
      if (std::isnan(r)) continue;
      sum += r * r;
      count += 1.0;
    }
  }
  return std::sqrt(sum / std::max(1.0, count));
}

/// Of the residuals with those `across` columns to the right and `down` rows below.
double correlation_at(const cv::Mat& residual, int across, int down, double sd) {
  double sum = 0.0, count = 0.0;
  for (int v = 0; v + down < residual.rows; ++v) {
    for (int u = 0; u + across < residual.cols; ++u) {
      const double product =
          static_cast<double>(residual.at<float>(v, u)) * residual.at<float>(v + down, u + across);
      if (std::isnan(product)) continue;
      sum += product;
      count += 1.0;
    }
  }
  return sum / std::max(1.0, count) / (sd * sd);
}

/// A window of the image as a plane: 1 / z = gradient . ray, and the gradient is its normal.
struct WindowPlane {
  double depth_m = 0.0, incidence_deg = 0.0;  ///< in the window's middle
  double rms_codes = 0.0, fill = 0.0;
  Eigen::Vector3d gradient_codes = Eigen::Vector3d::Zero();
};
bool fit_plane(const cv::Mat& codes, const cv::Rect& window, const PinholeModel& camera, double least_fill,
               WindowPlane* plane) {
  const auto ray = [&](double du, double dv) {
    return Eigen::Vector3d((window.x + du - camera.cx_px) / camera.fx_px,
                           (window.y + dv - camera.cy_px) / camera.fy_px, 1.0);
  };
  Eigen::Vector3d gradient;
  cv::Mat residual;
  if (!fit_surface<3>(codes(window), least_fill, ray, &gradient, &residual, &plane->fill)) return false;
  const Eigen::Vector3d middle = ray(0.5 * window.width, 0.5 * window.height);
  const double cosine = std::abs(gradient.dot(middle)) / (gradient.norm() * middle.norm());
  plane->gradient_codes = gradient;
  plane->rms_codes = rms(residual);
  plane->depth_m = 1.0 / (kInverseDepthPerCode * gradient.dot(middle));
  plane->incidence_deg = std::acos(std::min(1.0, cosine)) * 180.0 / kPi;
  return true;
}

int bin_of(double value, const double* edges, int bins) {
  for (int i = 0; i < bins; ++i) {
    if (value >= edges[i] && value < edges[i + 1]) return i;
  }
  return -1;
}

cv::Mat codes_of(const cv::Mat& depth_m) {
  cv::Mat codes(depth_m.rows, depth_m.cols, CV_32FC1);
  for (int v = 0; v < depth_m.rows; ++v) {
    for (int u = 0; u < depth_m.cols; ++u) {
      codes.at<float>(v, u) = static_cast<float>(1.0 / (kInverseDepthPerCode * depth_m.at<float>(v, u)));
    }
  }
  return codes;
}

}  // namespace

void SensorStatistics::add(const cv::Mat& depth_m, const PinholeModel& camera) {
  ++frames_;
  const cv::Mat codes = codes_of(depth_m);
  add_patches(codes, camera);
  add_tiles(codes, camera);
  add_levels(codes);
  if (walls_) add_bands(depth_m);
}

void SensorStatistics::add_patches(const cv::Mat& codes, const PinholeModel& camera) {
  Eigen::Matrix<double, 6, 1> surface;
  cv::Mat residual;
  double fill = 0.0;
  flat_pieces_.clear();
  const int margin = walls_ ? 0 : patch_px_ / 2;  // of what has to be a plane around the patch
  for (int v = margin; v + patch_px_ + margin <= codes.rows; v += patch_px_) {
    for (int u = kBorder_px + margin; u + patch_px_ + margin <= codes.cols - kBorder_px; u += patch_px_) {
      const cv::Rect window(u, v, patch_px_, patch_px_);
      if (!fit_surface<6>(codes(window), kPatchFill, quadratic_terms, &surface, &residual, &fill)) continue;
      const double sd = rms(residual);
      if (sd > kFlat_codes || sd < 1e-3) continue;
      const int side = patch_px_ + 2 * margin;
      WindowPlane plane;
      const cv::Rect surroundings(u - margin, v - margin, side, side);
      if (!fit_plane(codes, surroundings, camera, 0.9, &plane)) continue;
      if (!walls_ && plane.rms_codes > kPlane_codes) continue;
      Patch patch = {plane.incidence_deg, sd, {}, {}};
      for (std::size_t i = 0; i < kLags_px.size(); ++i) {
        patch.along_rows[i] = correlation_at(residual, kLags_px[i], 0, sd);
        patch.down_columns[i] = correlation_at(residual, 0, kLags_px[i], sd);
      }
      patches_.push_back(patch);
      flat_pieces_.push_back({surroundings, plane.gradient_codes});
    }
  }
}

void SensorStatistics::add_tiles(const cv::Mat& codes, const PinholeModel& camera) {
  WindowPlane plane;
  for (int v = 0; v + kTile_px <= codes.rows; v += kTile_px) {
    for (int u = kBorder_px; u + kTile_px <= codes.cols - kBorder_px; u += kTile_px) {
      if (!fit_plane(codes, {u, v, kTile_px, kTile_px}, camera, kTileFill, &plane)) continue;
      if (plane.rms_codes > kFlat_codes) continue;
      const int i = bin_of(plane.depth_m, kDepth_m.data(), kDepthBins);
      const int j = bin_of(plane.incidence_deg, kIncidence_deg.data(), kIncidenceBins);
      if (i < 0 || j < 0) continue;
      valid_tiles_[i][j] += 1.0;
      valid_sum_[i][j] += plane.fill;
    }
  }
}

void SensorStatistics::add_bands(const cv::Mat& depth_m) {
  Debander debander;
  cv::Mat copy = depth_m.clone();
  debander.remove_bands(&copy);
  for (const Debander::Step& step : debander.steps()) {
    if (step.column >= kBorder_px && step.column + kBorder_px < depth_m.cols)
      band_steps_.push_back(step.step_per_m / kInverseDepthPerCode);
  }
}

void SensorStatistics::add_levels(const cv::Mat& codes) {
  std::vector<double> values;
  std::set<int> different;
  for (int v = 0; v < codes.rows; ++v) {
    for (int u = 0; u < codes.cols; ++u) {
      if (!std::isnan(codes.at<float>(v, u))) values.push_back(codes.at<float>(v, u));
    }
  }
  if (values.size() < 1000) return;
  const double low = quantile(values, 0.01), high = quantile(values, 0.99);
  // Nearer than 0.6 m millimetres are coarser than codes.
  if (high - low < 3.0) return;
  for (const double value : values) {
    if (value >= low && value <= high) different.insert(static_cast<int>(std::lround(4.0 * value)));
  }
  levels_per_code_.push_back(static_cast<double>(different.size()) / (high - low + 1.0));
}

SensorStatistics::Noise SensorStatistics::noise(double from_deg, double to_deg) const {
  std::vector<double> sd;
  std::array<std::vector<double>, 3> along_rows, down_columns;
  for (const Patch& patch : patches_) {
    if (patch.incidence_deg < from_deg || patch.incidence_deg >= to_deg) continue;
    sd.push_back(patch.sd_codes);
    for (std::size_t i = 0; i < kLags_px.size(); ++i) {
      along_rows[i].push_back(patch.along_rows[i]);
      down_columns[i].push_back(patch.down_columns[i]);
    }
  }
  Noise noise;
  noise.patches = static_cast<int>(sd.size());
  noise.sd_codes = quantile(sd, 0.5);
  for (std::size_t i = 0; i < kLags_px.size(); ++i) {
    noise.along_rows[i] = quantile(along_rows[i], 0.5);
    noise.down_columns[i] = quantile(down_columns[i], 0.5);
  }
  return noise;
}

double SensorStatistics::band_step_codes() const {
  double sum = 0.0;
  for (const double step : band_steps_) sum += step * step;
  return std::sqrt(sum / static_cast<double>(band_steps_.size()));
}

double SensorStatistics::bands_per_frame() const {
  return static_cast<double>(band_steps_.size()) / std::max(1, frames_);
}

double SensorStatistics::levels_per_code() const { return quantile(levels_per_code_, 0.5); }

SensorStatistics::Valid SensorStatistics::valid(int depth_bin, int incidence_bin) const {
  const double tiles = valid_tiles_[depth_bin][incidence_bin];
  return {tiles, valid_sum_[depth_bin][incidence_bin] / std::max(1.0, tiles)};
}

cv::Mat residual_picture(const cv::Mat& depth_m) {
  Eigen::Matrix<double, 6, 1> surface;
  cv::Mat residual, picture(depth_m.rows, depth_m.cols, CV_8UC1, cv::Scalar(0));
  double fill = 0.0;
  if (!fit_surface<6>(codes_of(depth_m), 0.1, quadratic_terms, &surface, &residual, &fill)) return picture;
  for (int v = 0; v < picture.rows; ++v) {
    for (int u = 0; u < picture.cols; ++u) {
      const float r = residual.at<float>(v, u);
      if (!std::isnan(r))
        picture.at<std::uint8_t>(v, u) =
            static_cast<std::uint8_t>(std::clamp(128.0f + 42.0f * r, 1.0f, 255.0f));
    }
  }
  return picture;
}

}  // namespace knav
