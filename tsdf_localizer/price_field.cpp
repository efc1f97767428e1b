#include "tsdf_localizer/price_field.h"

#ifdef __x86_64__
// GCC 12 warns of its own header (bug 105593).
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#include <immintrin.h>
#endif

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

constexpr int kShift = 6, kOne = 1 << kShift;  // places are taken to 1/64 cell
constexpr std::size_t kLanes = 16;             // running sums; reading k goes to sum k mod 16, in all codes

/// The field and the pose: (x, y) = (x0 + c px - s py, y0 + s px + c py), in 1/64 cells from the rim's first centre.
struct View {
  const std::uint32_t* quads;
  int width;
  float last_x, last_y;
  float x0, y0, c, s;
};

/// Adds readings [from, to) to the running sums; a value is 255 * 64 * 64 for price 1.
void add_plain(const View& v, const WeightedPoints& points, std::size_t from, std::size_t to, float* lane) {
  for (std::size_t k = from; k < to; ++k) {
    float x = (v.x0 + v.c * points.x_m[k]) - v.s * points.y_m[k];
    float y = (v.y0 + v.s * points.x_m[k]) + v.c * points.y_m[k];
    x = x > 0.0f ? x : 0.0f;  // as the processor's maximum: 0 for NaN
    y = y > 0.0f ? y : 0.0f;
    x = x < v.last_x ? x : v.last_x;
    y = y < v.last_y ? y : v.last_y;
    const int fx = static_cast<int>(x), fy = static_cast<int>(y);
    const int tx = fx & (kOne - 1), ty = fy & (kOne - 1);
    const std::uint32_t quad = v.quads[(fy >> kShift) * v.width + (fx >> kShift)];
    const int low = static_cast<int>(quad & 255u) * (kOne - tx) + static_cast<int>(quad >> 8 & 255u) * tx;
    const int high = static_cast<int>(quad >> 16 & 255u) * (kOne - tx) + static_cast<int>(quad >> 24) * tx;
    lane[k % kLanes] += points.weight[k] * static_cast<float>(low * (kOne - ty) + high * ty);
  }
}

#ifdef __x86_64__
// The compiler finds neither the gather nor the multiply-add of bytes in the loop above (GCC 12), hence by hand; times are in
// docs/localization.md. Each returns how many readings it has done.
__attribute__((target("avx2"))) std::size_t add_avx2(const View& v, const WeightedPoints& points, float* lane) {
  const __m256 x0 = _mm256_set1_ps(v.x0), y0 = _mm256_set1_ps(v.y0), c = _mm256_set1_ps(v.c), s = _mm256_set1_ps(v.s);
  const __m256 zero = _mm256_setzero_ps(), last_x = _mm256_set1_ps(v.last_x), last_y = _mm256_set1_ps(v.last_y);
  const __m256i width = _mm256_set1_epi32(v.width), fraction = _mm256_set1_epi32(kOne - 1);
  const __m256i one_x = _mm256_set1_epi16(kOne), one_y = _mm256_set1_epi32(kOne);
  const int* quads = reinterpret_cast<const int*>(v.quads);
  const std::size_t count = points.size() - points.size() % kLanes;
  __m256 sums[2] = {_mm256_loadu_ps(lane), _mm256_loadu_ps(lane + 8)};
  for (std::size_t k = 0; k < count; k += kLanes) {
    for (std::size_t half = 0; half < 2; ++half) {
      const std::size_t i = k + 8 * half;
      const __m256 px = _mm256_loadu_ps(&points.x_m[i]), py = _mm256_loadu_ps(&points.y_m[i]);
      __m256 x = _mm256_sub_ps(_mm256_add_ps(x0, _mm256_mul_ps(c, px)), _mm256_mul_ps(s, py));
      __m256 y = _mm256_add_ps(_mm256_add_ps(y0, _mm256_mul_ps(s, px)), _mm256_mul_ps(c, py));
      x = _mm256_min_ps(_mm256_max_ps(x, zero), last_x);
      y = _mm256_min_ps(_mm256_max_ps(y, zero), last_y);
      const __m256i fx = _mm256_cvttps_epi32(x), fy = _mm256_cvttps_epi32(y);
      const __m256i tx = _mm256_and_si256(fx, fraction), ty = _mm256_and_si256(fy, fraction);
      const __m256i at = _mm256_add_epi32(_mm256_mullo_epi32(_mm256_srli_epi32(fy, kShift), width), _mm256_srli_epi32(fx, kShift));
      const __m256i quad = _mm256_i32gather_epi32(quads, at, 4);
      // bytes 64 - tx, tx, 64 - tx, tx; then words 64 - ty, ty
      const __m256i both = _mm256_or_si256(tx, _mm256_slli_epi32(tx, 16));
      const __m256i along_x = _mm256_add_epi16(_mm256_sub_epi16(_mm256_slli_epi16(both, 8), both), one_x);
      const __m256i along_y = _mm256_add_epi32(_mm256_sub_epi32(_mm256_slli_epi32(ty, 16), ty), one_y);
      const __m256i value = _mm256_madd_epi16(_mm256_maddubs_epi16(quad, along_x), along_y);
      sums[half] = _mm256_add_ps(sums[half], _mm256_mul_ps(_mm256_loadu_ps(&points.weight[i]), _mm256_cvtepi32_ps(value)));
    }
  }
  _mm256_storeu_ps(lane, sums[0]);
  _mm256_storeu_ps(lane + 8, sums[1]);
  return count;
}

__attribute__((target("avx512f,avx512bw"))) std::size_t add_avx512(const View& v, const WeightedPoints& points, float* lane) {
  const __m512 x0 = _mm512_set1_ps(v.x0), y0 = _mm512_set1_ps(v.y0), c = _mm512_set1_ps(v.c), s = _mm512_set1_ps(v.s);
  const __m512 zero = _mm512_setzero_ps(), last_x = _mm512_set1_ps(v.last_x), last_y = _mm512_set1_ps(v.last_y);
  const __m512i width = _mm512_set1_epi32(v.width), fraction = _mm512_set1_epi32(kOne - 1);
  const __m512i one_x = _mm512_set1_epi16(kOne), one_y = _mm512_set1_epi32(kOne);
  const std::size_t count = points.size() - points.size() % kLanes;
  __m512 sum = _mm512_loadu_ps(lane);
  for (std::size_t i = 0; i < count; i += kLanes) {
    const __m512 px = _mm512_loadu_ps(&points.x_m[i]), py = _mm512_loadu_ps(&points.y_m[i]);
    __m512 x = _mm512_sub_ps(_mm512_add_ps(x0, _mm512_mul_ps(c, px)), _mm512_mul_ps(s, py));
    __m512 y = _mm512_add_ps(_mm512_add_ps(y0, _mm512_mul_ps(s, px)), _mm512_mul_ps(c, py));
    x = _mm512_min_ps(_mm512_max_ps(x, zero), last_x);
    y = _mm512_min_ps(_mm512_max_ps(y, zero), last_y);
    const __m512i fx = _mm512_cvttps_epi32(x), fy = _mm512_cvttps_epi32(y);
    const __m512i tx = _mm512_and_si512(fx, fraction), ty = _mm512_and_si512(fy, fraction);
    const __m512i at = _mm512_add_epi32(_mm512_mullo_epi32(_mm512_srli_epi32(fy, kShift), width), _mm512_srli_epi32(fx, kShift));
    const __m512i quad = _mm512_i32gather_epi32(at, v.quads, 4);
    const __m512i both = _mm512_or_si512(tx, _mm512_slli_epi32(tx, 16));
    const __m512i along_x = _mm512_add_epi16(_mm512_sub_epi16(_mm512_slli_epi16(both, 8), both), one_x);
    const __m512i along_y = _mm512_add_epi32(_mm512_sub_epi32(_mm512_slli_epi32(ty, 16), ty), one_y);
    const __m512i value = _mm512_madd_epi16(_mm512_maddubs_epi16(quad, along_x), along_y);
    sum = _mm512_add_ps(sum, _mm512_mul_ps(_mm512_loadu_ps(&points.weight[i]), _mm512_cvtepi32_ps(value)));
  }
  _mm512_storeu_ps(lane, sum);
  return count;
}

const bool kHasAvx2 = __builtin_cpu_supports("avx2") != 0;
const bool kHasAvx512 = __builtin_cpu_supports("avx512f") != 0 && __builtin_cpu_supports("avx512bw") != 0;
#else
std::size_t add_avx2(const View&, const WeightedPoints&, float*) { return 0; }
std::size_t add_avx512(const View&, const WeightedPoints&, float*) { return 0; }
constexpr bool kHasAvx2 = false, kHasAvx512 = false;
#endif

float sum_of_prices(const View& view, const WeightedPoints& points, PriceCode code) {
  float lane[kLanes] = {};
  std::size_t done = 0;
  if (code == PriceCode::kAvx512) done = add_avx512(view, points, lane);
  if (code == PriceCode::kAvx2) done = add_avx2(view, points, lane);
  add_plain(view, points, done, points.size(), lane);
  for (std::size_t width = kLanes / 2; width > 0; width /= 2) {
    for (std::size_t i = 0; i < width; ++i) lane[i] += lane[i + width];
  }
  return lane[0];
}

}  // namespace

std::uint8_t quantized_price(double price) { return static_cast<std::uint8_t>(std::clamp(price, 0.0, 1.0) * 255.0 + 0.5); }

PriceField::PriceField(const GridGeometry& geometry, const std::vector<std::uint8_t>& prices, std::uint8_t outside)
    : geometry_(geometry), outside_(outside) {
  const auto columns = static_cast<std::size_t>(geometry.width_cells), rows = static_cast<std::size_t>(geometry.height_cells);
  const std::size_t wide = columns + 2;
  // two rows of single prices at a time, with the rim
  std::vector<std::uint8_t> low(wide + 1, outside), high(wide + 1, outside);
  quad_.resize(wide * (rows + 2));
  for (std::size_t row = 0; row < rows + 2; ++row) {
    if (row < rows) {
      std::copy_n(prices.begin() + static_cast<std::ptrdiff_t>(row * columns), columns, high.begin() + 1);
    } else {
      std::fill(high.begin(), high.end(), outside);
    }
    std::uint32_t* out = &quad_[row * wide];
    for (std::size_t x = 0; x < wide; ++x) {
      out[x] = low[x] | std::uint32_t{low[x + 1]} << 8 | std::uint32_t{high[x]} << 16 | std::uint32_t{high[x + 1]} << 24;
    }
    std::swap(low, high);
  }
}

double PriceField::at(int ix, int iy) const {
  if (!geometry_.contains(ix, iy)) return outside_ / 255.0;
  const auto row = static_cast<std::size_t>(iy) + 1, column = static_cast<std::size_t>(ix) + 1;
  return (quad_[row * static_cast<std::size_t>(width()) + column] & 255u) / 255.0;
}

bool has(PriceCode code) { return code == PriceCode::kAvx512 ? kHasAvx512 : code == PriceCode::kAvx2 ? kHasAvx2 : true; }

void mean_prices(const PriceField& field, const WeightedPoints& points, const ParticleSet& particles, std::vector<float>* price,
                 PriceCode code) {
  price->assign(particles.size(), 0.0f);
  float weight_sum = 0.0f;
  for (const float w : points.weight) weight_sum += w;
  if (!(weight_sum > 0.0f) || field.empty()) return;
  if (code == PriceCode::kBest || !has(code)) {
    code = kHasAvx512 ? PriceCode::kAvx512 : kHasAvx2 ? PriceCode::kAvx2 : PriceCode::kPlain;
  }
  const GridGeometry& grid = field.geometry();
  const float to_mean = 1.0f / (255.0f * kOne * kOne * weight_sum);
  const double scale = kOne / grid.resolution_m;
  View view{};
  view.quads = field.quads();
  view.width = field.width();
  view.last_x = static_cast<float>((grid.width_cells + 1) * kOne);
  view.last_y = static_cast<float>((grid.height_cells + 1) * kOne);
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const Pose2 T = particles.pose(i);
    view.c = static_cast<float>(std::cos(T.yaw_rad) * scale);
    view.s = static_cast<float>(std::sin(T.yaw_rad) * scale);
    // the rim's first centre lies half a cell outside the grid
    view.x0 = static_cast<float>((T.x_m - grid.origin_x_m) * scale + 0.5 * kOne);
    view.y0 = static_cast<float>((T.y_m - grid.origin_y_m) * scale + 0.5 * kOne);
    (*price)[i] = sum_of_prices(view, points, code) * to_mean;
  }
}

}  // namespace knav
