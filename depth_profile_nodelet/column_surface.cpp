#include "depth_profile_nodelet/column_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/multiversion.h"

namespace knav {
namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr int kKept = 8;  // smallest readings remembered per column
constexpr int kRounds = 4;
// Near the camera noise is millimetres, but surfaces slant and a tilted camera's levelled distance has more
// noise.
constexpr float kSmallestWindow_m = 0.015f;

/// Puts one row's readings beyond `beyond` into the sorted lists of their columns: a comparator chain without
/// branches.
KNAV_MULTIVERSION
void insert_row(const float* z_m, int width, const float* beyond_m, float range_max_m, float* smallest) {
  float* s0 = smallest;
  float *s1 = s0 + width, *s2 = s1 + width, *s3 = s2 + width, *s4 = s3 + width, *s5 = s4 + width,
        *s6 = s5 + width, *s7 = s6 + width;
#pragma GCC ivdep
  for (int u = 0; u < width; ++u) {
    const float z = z_m[u];
    float value = z <= range_max_m ? z : kInf;
    value = z > beyond_m[u] ? value : kInf;
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
  nearest_m_.assign(width, kNaN);
  window_end_m_.assign(width, kNaN);
  beyond_m_.assign(width, 0.0f);
  first_m_.assign(width, kNaN);
  // Where all of the smallest readings are strays, which is rare, the next ones are looked at.
  for (int round = 0; round < kRounds; ++round) {
    smallest_.assign(width * kKept, kInf);
    for (int v = 0; v < sliced.rows; ++v) {
      insert_row(sliced.ptr<float>(v), sliced.cols, beyond_m_.data(), range_max_m_, smallest_.data());
    }
    bool more = false;
    for (std::size_t u = 0; u < width; ++u) {
      if (!std::isnan(nearest_m_[u]) || std::isinf(beyond_m_[u])) continue;
      float sorted[kKept];
      for (std::size_t k = 0; k < kKept; ++k) sorted[k] = smallest_[k * width + u];
      if (round == 0 && std::isfinite(sorted[0])) first_m_[u] = sorted[0];
      nearest_m_[u] = first_supported(sorted);
      const bool full = std::isfinite(sorted[kKept - 1]);
      // The last ones may belong to a surface that goes on: they are looked at again.
      const int again = std::max(0, kKept - support_rows_);
      beyond_m_[u] = full && std::isnan(nearest_m_[u]) ? sorted[again] : kInf;
      more = more || !std::isinf(beyond_m_[u]);
    }
    if (!more) break;
  }
  for (std::size_t u = 0; u < width; ++u) {
    // Dozens of readings, none near another: something slanting and ragged, whose nearest point is the safe
    // answer.
    if (std::isnan(nearest_m_[u]) && !std::isinf(beyond_m_[u])) nearest_m_[u] = first_m_[u];
    window_end_m_[u] = window_end(nearest_m_[u]);
  }
}

float ColumnSurface::window_end(float nearest_m) const {
  if (std::isnan(nearest_m)) return kNaN;
  const float end_per_m = 1.0f / nearest_m - window_per_m_;
  const float by_noise = end_per_m > 1.0f / range_max_m_ ? 1.0f / end_per_m : range_max_m_;
  return std::min(range_max_m_, std::max(by_noise, nearest_m + kSmallestWindow_m));
}

float ColumnSurface::first_supported(const float* sorted) const {
  for (int i = 0; i + support_rows_ <= kKept; ++i) {
    const float last = sorted[i + support_rows_ - 1];
    if (!std::isfinite(last)) break;
    if (last <= window_end(sorted[i])) return sorted[i];
  }
  return kNaN;
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
