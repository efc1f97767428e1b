#include "kinect_calib/deband.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "kinect_calib/kinect_noise.h"

namespace knav {
namespace {

constexpr int kSide = 24;   // columns on either side that a step is judged by
constexpr int kBlocks = 6;  // of rows: a band's step is the same in all, the lens's error is not
constexpr double kSmallest = 0.2 * kInverseDepthPerCode;
constexpr double kSignificant = 4.0;  // standard errors
constexpr int kSmoothTerms = 4;

/// Without the outermost 3 % on either side. Not a median, nor the middle half: with noise of half a code
/// these follow the staircase of the codes, the mean does not.
double trimmed_mean(std::vector<float>* values) {
  const auto cut = static_cast<std::ptrdiff_t>(values->size() * 3 / 100);
  std::nth_element(values->begin(), values->begin() + cut, values->end());
  std::nth_element(values->begin() + cut, values->end() - 1 - cut, values->end());
  double sum = 0.0;
  for (auto it = values->begin() + cut; it != values->end() - cut; ++it) sum += *it;
  return sum / static_cast<double>(values->end() - values->begin() - 2 * cut);
}

/// The line through count values starting at first, evaluated at `at`; NaN if too many are missing.
double line_at(const std::vector<double>& values, int first, int count, double at) {
  double n = 0, x = 0, xx = 0, y = 0, xy = 0;
  for (int i = first; i < first + count; ++i) {
    const double value = values[static_cast<std::size_t>(i)];
    if (std::isnan(value)) continue;
    n += 1;
    x += i;
    xx += static_cast<double>(i) * i;
    y += value;
    xy += i * value;
  }
  if (n < 0.75 * count) return std::numeric_limits<double>::quiet_NaN();
  const double slope = (xy - x * y / n) / (xx - x * x / n);
  return y / n + slope * (at - x / n);
}

double median_of_steps(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

/// Mean inverse depth per column of some rows.
void Debander::average_columns(const cv::Mat& depth_m, int first_row, int last_row) {
  column_per_m_.assign(static_cast<std::size_t>(depth_m.cols), std::numeric_limits<double>::quiet_NaN());
  for (int u = 0; u < depth_m.cols; ++u) {
    values_.clear();
    for (int v = first_row; v < last_row; ++v) {
      const float z = depth_m.at<float>(v, u);
      if (z > 0.0f) values_.push_back(1.0f / z);
    }
    if (values_.size() < static_cast<std::size_t>(last_row - first_row) / 2 + 1) continue;
    column_per_m_[static_cast<std::size_t>(u)] = trimmed_mean(&values_);
  }
}

/// What a line on the right says at a boundary, less what a line on the left says: mean over the blocks of
/// rows, and its standard error, the typical one of the frame.
void Debander::measure_steps(const cv::Mat& depth_m) {
  const auto size = static_cast<std::size_t>(depth_m.cols);
  std::vector<double> sum(size, 0.0), squares(size, 0.0), count(size, 0.0);
  for (int block = 0; block < kBlocks; ++block) {
    average_columns(depth_m, depth_m.rows * block / kBlocks, depth_m.rows * (block + 1) / kBlocks);
    for (int u = kSide; u + kSide <= depth_m.cols; ++u) {
      const double step =
          line_at(column_per_m_, u, kSide, u - 0.5) - line_at(column_per_m_, u - kSide, kSide, u - 0.5);
      if (std::isnan(step)) continue;
      const auto i = static_cast<std::size_t>(u);
      sum[i] += step;
      squares[i] += step * step;
      count[i] += 1.0;
    }
  }
  step_per_m_.assign(size, 0.0);
  std::vector<double> errors;
  for (std::size_t u = 0; u < size; ++u) {
    if (count[u] < 2.0) continue;
    step_per_m_[u] = sum[u] / count[u];
    const double variance = (squares[u] - sum[u] * sum[u] / count[u]) / (count[u] - 1.0);
    errors.push_back(std::sqrt(std::max(0.0, variance) / count[u]));
  }
  error_per_m_ = errors.empty() ? 0.0 : median_of_steps(errors);
}

int Debander::remove_bands(cv::Mat* depth_m) {
  const int width = depth_m->cols;
  const auto size = static_cast<std::size_t>(width);
  measure_steps(*depth_m);
  const double smallest = std::max(kSmallest, kSignificant * error_per_m_);
  band_per_m_.assign(size, 0.0);
  steps_.clear();
  double level = 0.0;
  for (int u = 0; u < width; ++u) {
    const double step = step_per_m_[static_cast<std::size_t>(u)];
    bool largest = std::abs(step) > smallest;
    // A line across a step answers with the opposite sign beside it: the largest within a side wins.
    for (int i = std::max(0, u - kSide); largest && i <= std::min(width - 1, u + kSide); ++i) {
      const double other = std::abs(step_per_m_[static_cast<std::size_t>(i)]);
      largest = i == u || (i < u ? other < std::abs(step) : other <= std::abs(step));
    }
    if (largest) {
      level += step;
      steps_.push_back({u, step});
    }
    band_per_m_[static_cast<std::size_t>(u)] = level;
  }
  if (steps_.empty()) return 0;
  keep_smooth_part();
  for (int v = 0; v < depth_m->rows; ++v) {
    float* row = depth_m->ptr<float>(v);
    for (int u = 0; u < width; ++u) {
      row[u] = static_cast<float>(1.0 / (1.0 / row[u] - band_per_m_[static_cast<std::size_t>(u)]));
    }
  }
  return static_cast<int>(steps_.size());
}

/// A step that is missed, or wrongly measured, would shift all columns beyond it. Bands alternate; what the
/// staircase has of a polynomial across the image (its mean first of all) is left in the image.
void Debander::keep_smooth_part() {
  const auto width = static_cast<Eigen::Index>(band_per_m_.size());
  Eigen::MatrixXd terms(width, kSmoothTerms);
  for (Eigen::Index u = 0; u < width; ++u) {
    const double x = 2.0 * (static_cast<double>(u) + 0.5) / static_cast<double>(width) - 1.0;
    terms(u, 0) = 1.0;
    for (Eigen::Index k = 1; k < kSmoothTerms; ++k) terms(u, k) = terms(u, k - 1) * x;
  }
  Eigen::Map<Eigen::VectorXd> band(band_per_m_.data(), width);
  const Eigen::VectorXd smooth = (terms.transpose() * terms).ldlt().solve(terms.transpose() * band);
  band -= terms * smooth;
}

}  // namespace knav
