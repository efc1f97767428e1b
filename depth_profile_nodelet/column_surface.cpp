#include "depth_profile_nodelet/column_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kinect_calib/multiversion.h"

namespace knav {
namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr int kKept = 8;

/// Puts one row's readings into the sorted lists of their columns: a comparator chain without branches.
KNAV_MULTIVERSION
void insert_row(const float* z_m, int width, float range_max_m, float* smallest) {
  float* s0 = smallest;
  float *s1 = s0 + width, *s2 = s1 + width, *s3 = s2 + width, *s4 = s3 + width, *s5 = s4 + width,
        *s6 = s5 + width, *s7 = s6 + width;
#pragma GCC ivdep
  for (int u = 0; u < width; ++u) {
    float value = z_m[u] <= range_max_m ? z_m[u] : kInf;
    float kept;
#define KNAV_COMPARE(list)               \
  kept = list[u];                        \
  list[u] = value < kept ? value : kept; \
  value = value < kept ? kept : value;
    KNAV_COMPARE(s0)
    KNAV_COMPARE(s1)
    KNAV_COMPARE(s2)
    KNAV_COMPARE(s3)
    KNAV_COMPARE(s4)
    KNAV_COMPARE(s5)
    KNAV_COMPARE(s6)
    s7[u] = value < s7[u] ? value : s7[u];
#undef KNAV_COMPARE
  }
}

KNAV_MULTIVERSION
void sum_row(const float* z_m, int width, const float* from_m, const float* to_m, float* sum, float* count) {
#pragma GCC ivdep
  for (int u = 0; u < width; ++u) {
    const float z = z_m[u];
    const bool in = (z >= from_m[u]) & (z <= to_m[u]);
    sum[u] += in ? 1.0f / z : 0.0f;
    count[u] += in ? 1.0f : 0.0f;
  }
}

KNAV_MULTIVERSION
void minimum_row(const float* z_m, int width, float* minimum) {
  for (int u = 0; u < width; ++u) minimum[u] = z_m[u] < minimum[u] ? z_m[u] : minimum[u];
}

}  // namespace

void ColumnSurface::configure(int support_rows, double window_per_m, double range_max_m) {
  support_rows_ = std::clamp(support_rows, 1, kKept);
  window_per_m_ = static_cast<float>(window_per_m);
  range_max_m_ = static_cast<float>(range_max_m);
}

void ColumnSurface::find(const cv::Mat& sliced) {
  const auto width = static_cast<std::size_t>(sliced.cols);
  smallest_.assign(width * kKept, kInf);
  nearest_m_.resize(width);
  window_end_m_.resize(width);
  for (int v = 0; v < sliced.rows; ++v)
    insert_row(sliced.ptr<float>(v), sliced.cols, range_max_m_, smallest_.data());
  for (std::size_t u = 0; u < width; ++u) {
    float sorted[kKept];
    for (std::size_t k = 0; k < kKept; ++k) sorted[k] = smallest_[k * width + u];
    float nearest = first_supported(sorted, kKept);
    // All the smallest are strays: look at the whole column, which is rare.
    if (std::isnan(nearest) && std::isfinite(sorted[kKept - 1]))
      nearest = search_column(sliced, static_cast<int>(u));
    nearest_m_[u] = nearest;
    const float end_per_m = 1.0f / nearest - window_per_m_;
    window_end_m_[u] = std::isnan(nearest)               ? kNaN
                       : end_per_m > 1.0f / range_max_m_ ? 1.0f / end_per_m
                                                         : range_max_m_;
  }
}

float ColumnSurface::first_supported(const float* sorted, int count) const {
  for (int i = 0; i + support_rows_ <= count; ++i) {
    const float last = sorted[i + support_rows_ - 1];
    if (!std::isfinite(last)) break;
    if (1.0f / sorted[i] - 1.0f / last <= window_per_m_) return sorted[i];
  }
  return kNaN;
}

float ColumnSurface::search_column(const cv::Mat& sliced, int u) {
  column_.clear();
  for (int v = 0; v < sliced.rows; ++v) {
    const float z = sliced.ptr<float>(v)[u];
    if (z <= range_max_m_) column_.push_back(z);
  }
  std::sort(column_.begin(), column_.end());
  return first_supported(column_.data(), static_cast<int>(column_.size()));
}

void ColumnSurface::average(const cv::Mat& sliced, std::vector<float>* z_m) {
  const auto width = static_cast<std::size_t>(sliced.cols);
  sum_.assign(width, 0.0f);
  count_.assign(width, 0.0f);
  for (int v = 0; v < sliced.rows; ++v) {
    sum_row(sliced.ptr<float>(v), sliced.cols, nearest_m_.data(), window_end_m_.data(), sum_.data(),
            count_.data());
  }
  z_m->resize(width);
  for (std::size_t u = 0; u < width; ++u) (*z_m)[u] = count_[u] > 0.0f ? count_[u] / sum_[u] : kNaN;
}

void ColumnSurface::minimum(const cv::Mat& sliced, double range_max_m, std::vector<float>* z_m) {
  z_m->assign(static_cast<std::size_t>(sliced.cols), kInf);
  for (int v = 0; v < sliced.rows; ++v) minimum_row(sliced.ptr<float>(v), sliced.cols, z_m->data());
  for (float& z : *z_m) {
    if (!(z <= static_cast<float>(range_max_m))) z = kNaN;
  }
}

}  // namespace knav
