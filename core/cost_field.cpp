#include "core/cost_field.h"

#ifdef __x86_64__
#include <immintrin.h>
#endif

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

std::uint8_t quantized(double cost) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(cost, 0.0, 1.0) * 255.0));
}

/// What of the field the inner loop needs, and the pose: (x, y) = (x0 + c px - s py, y0 + s px + c py), in
/// cells.
struct View {
  const std::uint32_t* quads;
  int width;
  float last_x, last_y;  ///< points from here on are off the grid [cells]
  float outside;
  float blend;  ///< 1: interpolate, 0: nearest
  float x0, y0, c, s;
};

/// Adds readings [from, to) to eight running sums; reading k to sum k mod 8, as the vector code does.
void add_costs(const View& v, const WeightedPoints& points, std::size_t from, std::size_t to, float* lane) {
  for (std::size_t k = from; k < to; ++k) {
    float gx = v.x0 + v.c * points.x_m[k] - v.s * points.y_m[k];
    float gy = v.y0 + v.s * points.x_m[k] + v.c * points.y_m[k];
    float value = v.outside;
    if (gx >= 0.0f && gy >= 0.0f && gx < v.last_x && gy < v.last_y) {
      const int ix = static_cast<int>(gx), iy = static_cast<int>(gy);  // not negative: truncation is floor
      const float tx = (gx - static_cast<float>(ix)) * v.blend, ty = (gy - static_cast<float>(iy)) * v.blend;
      const std::uint32_t quad = v.quads[iy * v.width + ix];
      const auto a = static_cast<float>(quad & 255u), b = static_cast<float>(quad >> 8 & 255u);
      const auto d = static_cast<float>(quad >> 16 & 255u), e = static_cast<float>(quad >> 24);
      const float low = a + tx * (b - a), high = d + tx * (e - d);
      value = low + ty * (high - low);
    }
    lane[k % 8] += points.weight[k] * value;
  }
}

#ifdef __x86_64__
/// The same, eight at a time; operation by operation the same roundings. The compiler finds no gather in the
/// loop above (GCC 12), hence by hand: 8 ns -> 1 ns a reading, see benchmark_localizer. Returns how many it
/// has done.
__attribute__((target("avx2"))) std::size_t add_costs_avx2(const View& v, const WeightedPoints& points,
                                                           float* lane) {
  const __m256 x0 = _mm256_set1_ps(v.x0), y0 = _mm256_set1_ps(v.y0), c = _mm256_set1_ps(v.c),
               s = _mm256_set1_ps(v.s), zero = _mm256_setzero_ps();
  const __m256 last_x = _mm256_set1_ps(v.last_x), last_y = _mm256_set1_ps(v.last_y),
               outside = _mm256_set1_ps(v.outside), blend = _mm256_set1_ps(v.blend);
  const __m256i width = _mm256_set1_epi32(v.width), byte = _mm256_set1_epi32(255);
  const int* quads = reinterpret_cast<const int*>(v.quads);
  __m256 sum = _mm256_loadu_ps(lane);
  std::size_t k = 0;
  for (; k + 8 <= points.size(); k += 8) {
    const __m256 px = _mm256_loadu_ps(&points.x_m[k]), py = _mm256_loadu_ps(&points.y_m[k]);
    __m256 gx = _mm256_sub_ps(_mm256_add_ps(x0, _mm256_mul_ps(c, px)), _mm256_mul_ps(s, py));
    __m256 gy = _mm256_add_ps(_mm256_add_ps(y0, _mm256_mul_ps(s, px)), _mm256_mul_ps(c, py));
    const __m256 inside = _mm256_and_ps(
        _mm256_and_ps(_mm256_cmp_ps(gx, zero, _CMP_GE_OQ), _mm256_cmp_ps(gy, zero, _CMP_GE_OQ)),
        _mm256_and_ps(_mm256_cmp_ps(gx, last_x, _CMP_LT_OQ), _mm256_cmp_ps(gy, last_y, _CMP_LT_OQ)));
    gx = _mm256_and_ps(gx, inside);
    gy = _mm256_and_ps(gy, inside);
    const __m256i ix = _mm256_cvttps_epi32(gx), iy = _mm256_cvttps_epi32(gy);
    const __m256 tx = _mm256_mul_ps(_mm256_sub_ps(gx, _mm256_cvtepi32_ps(ix)), blend);
    const __m256 ty = _mm256_mul_ps(_mm256_sub_ps(gy, _mm256_cvtepi32_ps(iy)), blend);
    const __m256i quad =
        _mm256_i32gather_epi32(quads, _mm256_add_epi32(_mm256_mullo_epi32(iy, width), ix), 4);
    const __m256 a = _mm256_cvtepi32_ps(_mm256_and_si256(quad, byte));
    const __m256 b = _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32(quad, 8), byte));
    const __m256 d = _mm256_cvtepi32_ps(_mm256_and_si256(_mm256_srli_epi32(quad, 16), byte));
    const __m256 e = _mm256_cvtepi32_ps(_mm256_srli_epi32(quad, 24));
    const __m256 low = _mm256_add_ps(a, _mm256_mul_ps(tx, _mm256_sub_ps(b, a)));
    const __m256 high = _mm256_add_ps(d, _mm256_mul_ps(tx, _mm256_sub_ps(e, d)));
    const __m256 value =
        _mm256_blendv_ps(outside, _mm256_add_ps(low, _mm256_mul_ps(ty, _mm256_sub_ps(high, low))), inside);
    sum = _mm256_add_ps(sum, _mm256_mul_ps(_mm256_loadu_ps(&points.weight[k]), value));
  }
  _mm256_storeu_ps(lane, sum);
  return k;
}
const bool has_avx2 = __builtin_cpu_supports("avx2") != 0;
#else
std::size_t add_costs_avx2(const View&, const WeightedPoints&, float*) { return 0; }
constexpr bool has_avx2 = false;
#endif

float sum_of_costs(const View& view, const WeightedPoints& points, bool vectors) {
  float lane[8] = {};
  const std::size_t done = vectors ? add_costs_avx2(view, points, lane) : 0;
  add_costs(view, points, done, points.size(), lane);
  return ((lane[0] + lane[4]) + (lane[1] + lane[5])) + ((lane[2] + lane[6]) + (lane[3] + lane[7]));
}

}  // namespace

CostField::CostField(const GridGeometry& geometry, double outside_cost)
    : geometry_(geometry),
      quad_(geometry.cell_count(), quantized(outside_cost) * 0x01010101u),
      outside_(quantized(outside_cost)) {}

void CostField::put(int ix, int iy, int byte, std::uint8_t value) {
  if (!geometry_.contains(ix, iy)) return;
  std::uint32_t& quad = quad_[geometry_.index(ix, iy)];
  quad = (quad & ~(0xffu << (8 * byte))) | (static_cast<std::uint32_t>(value) << (8 * byte));
}

void CostField::set(int ix, int iy, double cost) {
  const std::uint8_t value = quantized(cost);
  put(ix, iy, 0, value);
  put(ix - 1, iy, 1, value);
  put(ix, iy - 1, 2, value);
  put(ix - 1, iy - 1, 3, value);
}

double CostField::at(int ix, int iy) const {
  return (geometry_.contains(ix, iy) ? quad_[geometry_.index(ix, iy)] & 255u : outside_) / 255.0;
}

void alignment_costs(const CostField& field, const WeightedPoints& points_robot, const ParticleSet& particles,
                     bool interpolate, std::vector<float>* cost, bool vectors) {
  cost->assign(particles.size(), 0.0f);
  const GridGeometry& grid = field.geometry();
  float weight_sum = 0.0f;
  for (const float w : points_robot.weight) weight_sum += w;
  if (!(weight_sum > 0.0f) || grid.cell_count() == 0) return;
  const float to_mean = 1.0f / (255.0f * weight_sum);
  const double scale = 1.0 / grid.resolution_m, shift = interpolate ? 0.5 : 0.0;
  const int margin = interpolate ? 1 : 0;
  View view{};
  view.quads = field.quads();
  view.width = grid.width_cells;
  view.last_x = static_cast<float>(grid.width_cells - margin);
  view.last_y = static_cast<float>(grid.height_cells - margin);
  view.outside = static_cast<float>(field.outside());
  view.blend = interpolate ? 1.0f : 0.0f;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const Pose2 T = particles.pose(i);
    view.c = static_cast<float>(std::cos(T.yaw_rad) * scale);
    view.s = static_cast<float>(std::sin(T.yaw_rad) * scale);
    view.x0 = static_cast<float>((T.x_m - grid.origin_x_m) * scale - shift);
    view.y0 = static_cast<float>((T.y_m - grid.origin_y_m) * scale - shift);
    (*cost)[i] = sum_of_costs(view, points_robot, vectors && has_avx2) * to_mean;
  }
}

}  // namespace knav
