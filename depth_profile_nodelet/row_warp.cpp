#include "depth_profile_nodelet/row_warp.h"

#include <limits>

#include "core/multiversion.h"

namespace knav {
namespace {

struct FloatMap {
  float a, b, c, d, fx_px, cx_px;
};

KNAV_MULTIVERSION
void find_sources(const FloatMap& map, int width_px, float* source_x, std::int32_t* source) {
  const float per_fx = 1.0f / map.fx_px;
  const float last = static_cast<float>(width_px) - 0.5f;
  const FloatMap m = map;
  for (int i = 0; i < width_px; ++i) {
    const float x = (static_cast<float>(i) - m.cx_px) * per_fx;
    const float from_x = (m.a * x + m.b) / (m.c * x + m.d);
    const float u = from_x * m.fx_px + m.cx_px;
    source_x[i] = from_x;
    const bool inside = u >= -0.5f && u < last;
    source[i] = static_cast<std::int32_t>((inside ? u : -1.5f) + 1.5f) - 1;  // rounds; -1 outside
  }
}

KNAV_MULTIVERSION
void gather(const std::int32_t* source, int width_px, const float* from, float* to) {
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  for (int i = 0; i < width_px; ++i) {
    const std::int32_t s = source[i];
    const float value = from[s < 0 ? 0 : s];
    to[i] = s < 0 ? kNaN : value;
  }
}

}  // namespace

bool RowWarp::set(const Map& map, double fx_px, double cx_px, int width_px) {
  source_.resize(static_cast<std::size_t>(width_px));
  source_x_.resize(static_cast<std::size_t>(width_px));
  find_sources({static_cast<float>(map.a), static_cast<float>(map.b), static_cast<float>(map.c),
                static_cast<float>(map.d), static_cast<float>(fx_px), static_cast<float>(cx_px)},
               width_px, source_x_.data(), source_.data());
  std::int32_t moved = 0;
  for (int i = 0; i < width_px; ++i) moved |= source_[static_cast<std::size_t>(i)] ^ i;
  return moved != 0;
}

void RowWarp::take(const float* from, float* to) const {
  gather(source_.data(), static_cast<int>(source_.size()), from, to);
}

}  // namespace knav
