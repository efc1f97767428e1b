#include "core/cost_field.h"

#include <algorithm>
#include <cmath>

#include "core/fast_math.h"
#include "core/multiversion.h"

#ifdef KNAV_HAVE_AVX2_CODE
#include <immintrin.h>
#endif

namespace knav {
namespace {

std::uint8_t quantized(double cost) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(cost, 0.0, 1.0) * 255.0));
}

// A reading's place between cell centres is taken to 1/128 of a cell, so that interpolating is whole-number
// arithmetic of bytes: exact, hence the same in plain and in vector code.
constexpr int kSubcellBits = 7;
constexpr int kShare = 127;  ///< the two shares along one axis sum to this

/// What of the field the inner loop needs, and the pose: (x, y) = (x0 + c px - s py, y0 + s px + c py), in
/// subcells (interpolating) or cells (nearest).
struct View {
  const std::uint32_t* quads;
  int width;
  float last_x, last_y;  ///< points from here on are off the grid
  float outside;         ///< cost there, in the units of the inside
  float x0, y0, c, s;
};

/// Adds readings [from, to) to eight running sums; reading k to sum k mod 8, as the vector code does.
template <bool kInterpolate>
void add_costs(const View& v, const WeightedPoints& points, std::size_t from, std::size_t to, float* lane) {
  for (std::size_t k = from; k < to; ++k) {
    const float gx = v.x0 + v.c * points.x_m[k] - v.s * points.y_m[k];
    const float gy = v.y0 + v.s * points.x_m[k] + v.c * points.y_m[k];
    float cost = v.outside;
    if (gx >= 0.0f && gy >= 0.0f && gx < v.last_x && gy < v.last_y) {
      const int sx = static_cast<int>(gx), sy = static_cast<int>(gy);  // not negative: truncation is floor
      if constexpr (kInterpolate) {
        const int tx = sx & kShare, ty = sy & kShare;
        const std::uint32_t quad = v.quads[(sy >> kSubcellBits) * v.width + (sx >> kSubcellBits)];
        const auto byte = [quad](int i) { return static_cast<int>((quad >> (8 * i)) & 255u); };
        const int low = byte(0) * (kShare - tx) + byte(1) * tx, high = byte(2) * (kShare - tx) + byte(3) * tx;
        cost = static_cast<float>(low * (kShare - ty) + high * ty);
      } else {
        cost = static_cast<float>(v.quads[sy * v.width + sx] & 255u);
      }
    }
    lane[k % 8] += points.weight[k] * cost;
  }
}

#ifdef KNAV_HAVE_AVX2_CODE
/// The same, eight at a time. The compiler finds no gather in the loop above (GCC 12), hence by hand; see
/// benchmark_core_tsdf. Returns how many it has done.
/// @tparam kInside  all readings are known to lie on the grid
template <bool kInterpolate, bool kInside>
KNAV_AVX2 std::size_t add_costs_avx2(const View& v, const WeightedPoints& points, float* lane) {
  const __m256 x0 = _mm256_set1_ps(v.x0), y0 = _mm256_set1_ps(v.y0), c = _mm256_set1_ps(v.c),
               s = _mm256_set1_ps(v.s);
  const __m256i all_bytes = _mm256_setr_epi8(0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8, 12, 12, 12, 12,  //
                                             0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8, 12, 12, 12, 12);
  const __m256i both_words = _mm256_setr_epi8(0, -1, 0, -1, 4, -1, 4, -1, 8, -1, 8, -1, 12, -1, 12, -1,  //
                                              0, -1, 0, -1, 4, -1, 4, -1, 8, -1, 8, -1, 12, -1, 12, -1);
  const __m256i flip_x = _mm256_set1_epi32(0x007F007F), flip_y = _mm256_set1_epi32(0x0000007F),
                share_bits = _mm256_set1_epi8(kShare), word_bits = _mm256_set1_epi16(kShare),
                byte = _mm256_set1_epi32(255), width = _mm256_set1_epi32(v.width);
  const int* quads = reinterpret_cast<const int*>(v.quads);
  __m256 sum = _mm256_loadu_ps(lane);
  std::size_t k = 0;
  for (; k + 8 <= points.size(); k += 8) {
    const __m256 px = _mm256_loadu_ps(&points.x_m[k]), py = _mm256_loadu_ps(&points.y_m[k]);
    __m256 gx = _mm256_sub_ps(_mm256_add_ps(x0, _mm256_mul_ps(c, px)), _mm256_mul_ps(s, py));
    __m256 gy = _mm256_add_ps(_mm256_add_ps(y0, _mm256_mul_ps(s, px)), _mm256_mul_ps(c, py));
    __m256 inside = _mm256_setzero_ps();
    if (!kInside) {
      const __m256 zero = _mm256_setzero_ps();
      inside = _mm256_and_ps(
          _mm256_and_ps(_mm256_cmp_ps(gx, zero, _CMP_GE_OQ), _mm256_cmp_ps(gy, zero, _CMP_GE_OQ)),
          _mm256_and_ps(_mm256_cmp_ps(gx, _mm256_set1_ps(v.last_x), _CMP_LT_OQ),
                        _mm256_cmp_ps(gy, _mm256_set1_ps(v.last_y), _CMP_LT_OQ)));
      gx = _mm256_and_ps(gx, inside);
      gy = _mm256_and_ps(gy, inside);
    }
    const __m256i sx = _mm256_cvttps_epi32(gx), sy = _mm256_cvttps_epi32(gy);
    const __m256i ix = kInterpolate ? _mm256_srli_epi32(sx, kSubcellBits) : sx;
    const __m256i iy = kInterpolate ? _mm256_srli_epi32(sy, kSubcellBits) : sy;
    const __m256i quad =
        _mm256_i32gather_epi32(quads, _mm256_add_epi32(_mm256_mullo_epi32(iy, width), ix), 4);
    __m256i value;
    if (kInterpolate) {
      // Shares along x as bytes [127 - t, t, 127 - t, t], along y as words [127 - t, t]; 127 - t = t ^ 127.
      const __m256i tx = _mm256_and_si256(_mm256_shuffle_epi8(sx, all_bytes), share_bits);
      const __m256i ty = _mm256_and_si256(_mm256_shuffle_epi8(sy, both_words), word_bits);
      value = _mm256_madd_epi16(_mm256_maddubs_epi16(quad, _mm256_xor_si256(tx, flip_x)),
                                _mm256_xor_si256(ty, flip_y));
    } else {
      value = _mm256_and_si256(quad, byte);
    }
    __m256 cost = _mm256_cvtepi32_ps(value);
    if (!kInside) cost = _mm256_blendv_ps(_mm256_set1_ps(v.outside), cost, inside);
    sum = _mm256_add_ps(sum, _mm256_mul_ps(_mm256_loadu_ps(&points.weight[k]), cost));
  }
  _mm256_storeu_ps(lane, sum);
  return k;
}
#endif

template <bool kInterpolate>
float sum_of_costs(const View& v, const WeightedPoints& points, float reach, bool vectors) {
  float lane[8] = {};
  std::size_t done = 0;
#ifdef KNAV_HAVE_AVX2_CODE
  if (vectors) {
    const bool inside =
        v.x0 - reach >= 0.0f && v.y0 - reach >= 0.0f && v.x0 + reach < v.last_x && v.y0 + reach < v.last_y;
    done = inside ? add_costs_avx2<kInterpolate, true>(v, points, lane)
                  : add_costs_avx2<kInterpolate, false>(v, points, lane);
  }
#endif
  add_costs<kInterpolate>(v, points, done, points.size(), lane);
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
  float weight_sum = 0.0f, reach_m = 0.0f;
  for (std::size_t k = 0; k < points_robot.size(); ++k) {
    weight_sum += points_robot.weight[k];
    reach_m = std::max(reach_m, std::fabs(points_robot.x_m[k]) + std::fabs(points_robot.y_m[k]));
  }
  if (!(weight_sum > 0.0f) || grid.cell_count() == 0) return;
  const double per_cell = interpolate ? 1 << kSubcellBits : 1;
  const double scale = per_cell / grid.resolution_m, shift = interpolate ? 0.5 * per_cell : 0.0;
  const int margin = interpolate ? 1 : 0;
  const float unit = interpolate ? static_cast<float>(kShare * kShare) : 1.0f;
  const float to_mean = 1.0f / (255.0f * unit * weight_sum);
  const float reach = static_cast<float>(reach_m * scale + per_cell);
  View view{};
  view.quads = field.quads();
  view.width = grid.width_cells;
  view.last_x = static_cast<float>((grid.width_cells - margin) * per_cell);
  view.last_y = static_cast<float>((grid.height_cells - margin) * per_cell);
  view.outside = static_cast<float>(field.outside()) * unit;
  static thread_local std::vector<double> cosine, sine;
  cosine.resize(particles.size());
  sine.resize(particles.size());
  cos_sin(particles.yaw_rad.data(), particles.size(), cosine.data(), sine.data());
  const bool use_vectors = vectors && cpu_has_avx2();
  for (std::size_t i = 0; i < particles.size(); ++i) {
    view.c = static_cast<float>(cosine[i] * scale);
    view.s = static_cast<float>(sine[i] * scale);
    view.x0 = static_cast<float>((particles.x_m[i] - grid.origin_x_m) * scale - shift);
    view.y0 = static_cast<float>((particles.y_m[i] - grid.origin_y_m) * scale - shift);
    (*cost)[i] = to_mean * (interpolate ? sum_of_costs<true>(view, points_robot, reach, use_vectors)
                                        : sum_of_costs<false>(view, points_robot, reach, use_vectors));
  }
}

}  // namespace knav
