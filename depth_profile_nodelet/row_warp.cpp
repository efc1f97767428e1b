#include "depth_profile_nodelet/row_warp.h"

#include <algorithm>
#include <limits>

#include "core/multiversion.h"

namespace knav {
namespace {

constexpr int kBlock = 16;           // the shift is monotonic over so few columns, to a thousandth of a pixel
constexpr float kMost_px = 4096.0f;  // beyond any image; keeps the rounding within an int

struct FloatMap {
  float a, b, c, d, per_fx, fx_px, cx_px;
};

/// Rounded shifts of the columns 0, step, 2 step, ...
KNAV_MULTIVERSION
void rounded_shifts(const FloatMap& map, int first, int step, int count, std::int32_t* shift) {
  const FloatMap m = map;
  for (int k = 0; k < count; ++k) {
    const float u = static_cast<float>(first + k * step);
    const float x = (u - m.cx_px) * m.per_fx;
    float moved = (m.a * x + m.b) / (m.c * x + m.d) * m.fx_px + m.cx_px - u;
    moved = moved > -kMost_px ? moved : -kMost_px;
    moved = moved < kMost_px ? moved : kMost_px;
    shift[k] = static_cast<std::int32_t>(moved + (kMost_px + 0.5f)) - static_cast<std::int32_t>(kMost_px);
  }
}

}  // namespace

float RowWarp::shift_px(int u) const {
  const float x = (static_cast<float>(u) - cx_px_) / fx_px_;
  return (a_ * x + b_) / (c_ * x + d_) * fx_px_ + cx_px_ - static_cast<float>(u);
}

void RowWarp::add(int begin, int end, int shift) {
  if (!runs_.empty() && runs_.back().shift == shift) {
    runs_.back().end = end;
  } else {
    runs_.push_back({begin, end, shift});
  }
}

bool RowWarp::set(const Map& map, double fx_px, double cx_px, int width_px) {
  a_ = static_cast<float>(map.a);
  b_ = static_cast<float>(map.b);
  c_ = static_cast<float>(map.c);
  d_ = static_cast<float>(map.d);
  fx_px_ = static_cast<float>(fx_px);
  cx_px_ = static_cast<float>(cx_px);
  width_px_ = width_px;
  const FloatMap floats = {a_, b_, c_, d_, 1.0f / fx_px_, fx_px_, cx_px_};
  const int blocks = (width_px + kBlock - 1) / kBlock;
  block_shift_.resize(static_cast<std::size_t>(blocks) + 1);
  runs_.reserve(static_cast<std::size_t>(width_px));
  rounded_shifts(floats, 0, kBlock, blocks + 1, block_shift_.data());
  runs_.clear();
  for (int k = 0; k < blocks; ++k) {
    const int begin = k * kBlock, end = std::min(begin + kBlock, width_px);
    const std::int32_t first = block_shift_[static_cast<std::size_t>(k)];
    if (first == block_shift_[static_cast<std::size_t>(k) + 1]) {
      add(begin, end, first);
      continue;
    }
    std::int32_t shift[kBlock];
    rounded_shifts(floats, begin, 1, kBlock, shift);
    for (int u = begin; u < end; ++u) add(u, u + 1, shift[u - begin]);
  }
  return runs_.size() != 1 || runs_[0].shift != 0;
}

void RowWarp::take(const float* from, float* to) const {
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  for (const Run& run : runs_) {
    const int first = std::clamp(-run.shift, run.begin, run.end);
    const int last = std::clamp(width_px_ - run.shift, first, run.end);
    std::fill(to + run.begin, to + first, kNaN);
    std::copy(from + first + run.shift, from + last + run.shift, to + first);
    std::fill(to + last, to + run.end, kNaN);
  }
}

}  // namespace knav
