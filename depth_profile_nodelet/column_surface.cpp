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
/// From about 20 m on a Kinect's disparity saturates and answers with anything, also with 15 m, block of rows by block of
/// rows. A surface farther than this must show so much height, in more rows than the column has beyond its range.
constexpr float kDoubtful_m = 10.0f, kDoubtfulHeight_m = 0.6f;
// Near the camera noise is millimetres, but surfaces slant and a tilted camera's levelled distance has more
// noise.
constexpr float kSmallestWindow_m = 0.015f;

/// A strip of eight columns: GCC's own vectors, so that the eight sorted lists stay in registers down all the
/// rows, in whichever version runs.
constexpr int kStrip = 8;
typedef float Strip __attribute__((vector_size(sizeof(float) * kStrip), aligned(4)));

/// The kept smallest readings beyond `beyond_m` of eight columns, ascending: a comparator chain without
/// branches. @param z_m the strip's first reading, @param stride from row to row
KNAV_MULTIVERSION
void smallest_of_strip(const float* z_m, std::size_t stride, int rows, const float* beyond_m,
                       float range_max_m, float* smallest) {
  const Strip none = {kInf, kInf, kInf, kInf, kInf, kInf, kInf, kInf};
  Strip s0 = none, s1 = none, s2 = none, s3 = none, s4 = none, s5 = none, s6 = none, s7 = none;
  const Strip beyond = *reinterpret_cast<const Strip*>(beyond_m);
  for (int v = 0; v < rows; ++v, z_m += stride) {
    const Strip z = *reinterpret_cast<const Strip*>(z_m);
    Strip value = (z <= range_max_m) & (z > beyond) ? z : none;
    Strip kept;
#define KNAV_COMPARE(list)            \
  kept = list;                        \
  list = value < kept ? value : kept; \
  value = value < kept ? kept : value;
    KNAV_COMPARE(s0)
    KNAV_COMPARE(s1)
    KNAV_COMPARE(s2)
    KNAV_COMPARE(s3)
    KNAV_COMPARE(s4)
    KNAV_COMPARE(s5)
    KNAV_COMPARE(s6)
    s7 = value < s7 ? value : s7;
#undef KNAV_COMPARE
  }
  Strip* out = reinterpret_cast<Strip*>(smallest);
  out[0] = s0;
  out[1] = s1;
  out[2] = s2;
  out[3] = s3;
  out[4] = s4;
  out[5] = s5;
  out[6] = s6;
  out[7] = s7;
}

KNAV_MULTIVERSION
void sum_row(const float* z_m, int width, const float* from_m, const float* to_m, float range_max_m,
             float* sum, float* count, float* beyond) {
#pragma GCC ivdep
  for (int u = 0; u < width; ++u) {
    const float z = z_m[u];
    const bool in = (z >= from_m[u]) & (z <= to_m[u]);
    sum[u] += in ? 1.0f / z : 0.0f;
    count[u] += in ? 1.0f : 0.0f;
    beyond[u] += z > range_max_m ? 1.0f : 0.0f;
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

void ColumnSurface::find(const cv::Mat& sliced, double fy_px) {
  const auto width = static_cast<std::size_t>(sliced.cols);
  nearest_m_.assign(width, kNaN);
  window_end_m_.assign(width, kNaN);
  for (int first = 0; first < sliced.cols; first += kStrip) find_in_strip(sliced, first);
  for (std::size_t u = 0; u < width; ++u) window_end_m_[u] = window_end(nearest_m_[u]);
  sum_windows(sliced);
  drop_doubtful(static_cast<float>(fy_px));
}

void ColumnSurface::sum_windows(const cv::Mat& sliced) {
  const auto width = static_cast<std::size_t>(sliced.cols);
  for (auto* sums : {&sum_, &count_, &beyond_}) sums->assign(width, 0.0f);
  for (int v = 0; v < sliced.rows; ++v) {
    sum_row(sliced.ptr<float>(v), sliced.cols, nearest_m_.data(), window_end_m_.data(), range_max_m_, sum_.data(),
            count_.data(), beyond_.data());
  }
}

void ColumnSurface::drop_doubtful(float fy_px) {
  for (std::size_t u = 0; u < nearest_m_.size(); ++u) {
    const float z_m = count_[u] / sum_[u];
    if (!(z_m > kDoubtful_m) || (count_[u] >= beyond_[u] && count_[u] * z_m >= fy_px * kDoubtfulHeight_m)) continue;
    nearest_m_[u] = window_end_m_[u] = kNaN;
    count_[u] = 0.0f;
  }
}

void ColumnSurface::find_in_strip(const cv::Mat& sliced, int first_column) {
  const int columns = std::min(kStrip, sliced.cols - first_column);
  const cv::Mat within = sliced.colRange(first_column, first_column + columns);
  if (columns < kStrip) {  // the image's last columns
    narrow_.create(sliced.rows, kStrip, CV_32FC1);
    narrow_.setTo(kNaN);
    within.copyTo(narrow_.colRange(0, columns));
  }
  const cv::Mat& strip = columns < kStrip ? narrow_ : within;
  float nearest[kStrip], first[kStrip], beyond[kStrip], smallest[kStrip * kKept];
  std::fill(nearest, nearest + kStrip, kNaN);
  std::fill(first, first + kStrip, kNaN);
  std::fill(beyond, beyond + kStrip, 0.0f);
  // Where all of the smallest readings are strays, which is rare, the next ones are looked at.
  bool more = true;
  for (int round = 0; round < kRounds && more; ++round) {
    smallest_of_strip(strip.ptr<float>(0), strip.step1(), strip.rows, beyond, range_max_m_, smallest);
    more = false;
    for (int i = 0; i < kStrip; ++i) {
      if (!std::isnan(nearest[i]) || std::isinf(beyond[i])) continue;
      float sorted[kKept];
      for (int k = 0; k < kKept; ++k) sorted[k] = smallest[k * kStrip + i];
      if (round == 0 && std::isfinite(sorted[0])) first[i] = sorted[0];
      nearest[i] = first_supported(sorted);
      const bool full = std::isfinite(sorted[kKept - 1]);
      // The last ones may belong to a surface that goes on: they are looked at again.
      const int again = std::max(0, kKept - support_rows_);
      beyond[i] = full && std::isnan(nearest[i]) ? sorted[again] : kInf;
      more = more || !std::isinf(beyond[i]);
    }
  }
  for (int i = 0; i < columns; ++i) {
    // Dozens of readings, none near another: something slanting and ragged, whose nearest point is the safe
    // answer.
    if (std::isnan(nearest[i]) && !std::isinf(beyond[i])) nearest[i] = first[i];
    nearest_m_[static_cast<std::size_t>(first_column + i)] = nearest[i];
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

void ColumnSurface::average(std::vector<float>* z_m) const {
  z_m->resize(count_.size());
  for (std::size_t u = 0; u < count_.size(); ++u) (*z_m)[u] = count_[u] > 0.0f ? count_[u] / sum_[u] : kNaN;
}

void ColumnSurface::count_rows(std::vector<std::uint8_t>* rows) const {
  rows->resize(count_.size());
  for (std::size_t u = 0; u < count_.size(); ++u) (*rows)[u] = static_cast<std::uint8_t>(std::min(count_[u], 255.0f));
}

void ColumnSurface::minimum(const cv::Mat& sliced, double range_max_m, std::vector<float>* z_m) {
  z_m->assign(static_cast<std::size_t>(sliced.cols), kInf);
  for (int v = 0; v < sliced.rows; ++v) minimum_row(sliced.ptr<float>(v), sliced.cols, z_m->data());
  for (float& z : *z_m) {
    if (!(z <= static_cast<float>(range_max_m))) z = kNaN;
  }
}

}  // namespace knav
