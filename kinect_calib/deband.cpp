#include "kinect_calib/deband.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kinect_calib/kinect_noise.h"

namespace knav {
namespace {

constexpr int kSide = 12;  // columns on either side that a step is judged by
constexpr double kSmallest =
    0.12 * kInverseDepthPerCode;  // a column's median over 480 rows is good to 0.03 codes

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

}  // namespace

int Debander::remove_bands(cv::Mat* depth_m) {
  const int width = depth_m->cols;
  const auto size = static_cast<std::size_t>(width);
  column_per_m_.assign(size, std::numeric_limits<double>::quiet_NaN());
  for (int u = 0; u < width; ++u) {
    values_.clear();
    for (int v = 0; v < depth_m->rows; ++v) {
      const float z = depth_m->at<float>(v, u);
      if (z > 0.0f) values_.push_back(1.0f / z);
    }
    if (values_.size() < static_cast<std::size_t>(depth_m->rows) / 8 + 1) continue;
    column_per_m_[static_cast<std::size_t>(u)] = trimmed_mean(&values_);
  }
  // What a line on the right says at a boundary, less what a line on the left says.
  step_per_m_.assign(size, 0.0);
  for (int u = kSide; u + kSide <= width; ++u) {
    const double step =
        line_at(column_per_m_, u, kSide, u - 0.5) - line_at(column_per_m_, u - kSide, kSide, u - 0.5);
    step_per_m_[static_cast<std::size_t>(u)] = std::isnan(step) ? 0.0 : step;
  }
  band_per_m_.assign(size, 0.0);
  double level = 0.0, mean = 0.0;
  int steps = 0;
  for (int u = 0; u < width; ++u) {
    const double step = step_per_m_[static_cast<std::size_t>(u)];
    bool largest = std::abs(step) > kSmallest;
    // A line across a step answers with the opposite sign beside it: the largest within a side wins.
    for (int i = std::max(0, u - kSide); largest && i <= std::min(width - 1, u + kSide); ++i) {
      const double other = std::abs(step_per_m_[static_cast<std::size_t>(i)]);
      largest = i == u || (i < u ? other < std::abs(step) : other <= std::abs(step));
    }
    if (largest) {
      level += step;
      ++steps;
    }
    band_per_m_[static_cast<std::size_t>(u)] = level;
    mean += level / width;
  }
  if (steps == 0) return 0;
  for (double& band : band_per_m_) band -= mean;
  for (int v = 0; v < depth_m->rows; ++v) {
    float* row = depth_m->ptr<float>(v);
    for (int u = 0; u < width; ++u) {
      row[u] = static_cast<float>(1.0 / (1.0 / row[u] - band_per_m_[static_cast<std::size_t>(u)]));
    }
  }
  return steps;
}

}  // namespace knav
