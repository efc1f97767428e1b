#include "core/tsdf_alignment.h"

#include <algorithm>
#include <cmath>

#include "core/fast_math.h"
#include "core/multiversion.h"
#include "core/parts.h"

#ifdef KNAV_HAVE_AVX2_CODE
#include <immintrin.h>
#endif

namespace knav {
namespace {

// A reading's place within its four cells is taken to 1/256 of a cell (0.2 mm), so that interpolating is
// whole-number arithmetic of bytes: exact, hence the same in plain and in vector code.
constexpr int kSubcellBits = 8;
constexpr float kSubcells = 256.0f;
constexpr int kShares = 255 * 255;  ///< what the four shares of a reading sum to

/// What of the grid the inner loop needs. Coordinates count subcells from the window's lower left corner.
struct Window {
  const std::uint32_t* quads;
  int stride, mask;
  int first_x, first_y;  ///< of the window, in the torus
  float last;            ///< points from here on are off the window
  float price;           ///< of an unknown share
  float off_window;      ///< cost of a point off the window
};

/// (x, y) = (x0 + c px - s py, y0 + s px + c py), in subcells.
struct ScaledPose {
  float x0, y0, c, s;
};

/// Adds readings [from, to) to eight running sums, reading k to sum k mod 8, as the vector code does.
void add_costs(const Window& w, const ScaledPose& pose, const WeightedPoints& points, std::size_t from,
               std::size_t to, float* lane) {
  for (std::size_t k = from; k < to; ++k) {
    const float gx = pose.x0 + pose.c * points.x_m[k] - pose.s * points.y_m[k];
    const float gy = pose.y0 + pose.s * points.x_m[k] + pose.c * points.y_m[k];
    float cost = w.off_window;
    if (gx >= 0.0f && gy >= 0.0f && gx < w.last && gy < w.last) {
      const int sx = static_cast<int>(gx), sy = static_cast<int>(gy);  // not negative: truncation is floor
      const int ix = ((sx >> kSubcellBits) + w.first_x) & w.mask,
                iy = ((sy >> kSubcellBits) + w.first_y) & w.mask;
      const std::uint32_t quad = w.quads[iy * w.stride + ix];
      const int tx = sx & 255, ty = sy & 255;
      const int share[4] = {(255 - tx) * (255 - ty), tx * (255 - ty), (255 - tx) * ty, tx * ty};
      int value = 0, known = 0;
      for (int corner = 0; corner < 4; ++corner) {
        const auto byte = static_cast<std::int8_t>((quad >> (8 * corner)) & 0xFFu);
        if (byte == TsdfGrid::kUnknown) continue;
        value += share[corner] * byte;
        known += share[corner];
      }
      cost = static_cast<float>(value < 0 ? -value : value) + static_cast<float>(kShares - known) * w.price;
    }
    lane[k % 8] += points.weight[k] * cost;
  }
}

#ifdef KNAV_HAVE_AVX2_CODE
/// The same, eight at a time. Returns how many it has done.
/// @tparam kInside  all readings are known to lie in the window
template <bool kInside>
KNAV_AVX2 std::size_t add_costs_avx2(const Window& w, const ScaledPose& pose, const WeightedPoints& points,
                                     float* lane) {
  const __m256 x0 = _mm256_set1_ps(pose.x0), y0 = _mm256_set1_ps(pose.y0), c = _mm256_set1_ps(pose.c),
               s = _mm256_set1_ps(pose.s), price = _mm256_set1_ps(w.price);
  const __m256i first_x = _mm256_set1_epi32(w.first_x), first_y = _mm256_set1_epi32(w.first_y),
                mask = _mm256_set1_epi32(w.mask), unknown = _mm256_set1_epi8(TsdfGrid::kUnknown);
  const __m256i stride = _mm256_set1_epi32(w.stride);
  const __m256i all_bytes = _mm256_setr_epi8(0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8, 12, 12, 12, 12,  //
                                             0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8, 12, 12, 12, 12);
  const __m256i both_words = _mm256_setr_epi8(0, -1, 0, -1, 4, -1, 4, -1, 8, -1, 8, -1, 12, -1, 12, -1,  //
                                              0, -1, 0, -1, 4, -1, 4, -1, 8, -1, 8, -1, 12, -1, 12, -1);
  const __m256i flip_x = _mm256_set1_epi32(0x00FF00FF), flip_y = _mm256_set1_epi32(0x000000FF);
  const int* quads = reinterpret_cast<const int*>(w.quads);
  __m256 sum = _mm256_loadu_ps(lane);
  std::size_t k = 0;
  for (; k + 8 <= points.size(); k += 8) {
    const __m256 px = _mm256_loadu_ps(&points.x_m[k]), py = _mm256_loadu_ps(&points.y_m[k]);
    __m256 gx = _mm256_sub_ps(_mm256_add_ps(x0, _mm256_mul_ps(c, px)), _mm256_mul_ps(s, py));
    __m256 gy = _mm256_add_ps(_mm256_add_ps(y0, _mm256_mul_ps(s, px)), _mm256_mul_ps(c, py));
    __m256 inside = _mm256_setzero_ps();
    if (!kInside) {
      const __m256 zero = _mm256_setzero_ps(), last = _mm256_set1_ps(w.last);
      inside = _mm256_and_ps(
          _mm256_and_ps(_mm256_cmp_ps(gx, zero, _CMP_GE_OQ), _mm256_cmp_ps(gy, zero, _CMP_GE_OQ)),
          _mm256_and_ps(_mm256_cmp_ps(gx, last, _CMP_LT_OQ), _mm256_cmp_ps(gy, last, _CMP_LT_OQ)));
      gx = _mm256_and_ps(gx, inside);
      gy = _mm256_and_ps(gy, inside);
    }
    const __m256i sx = _mm256_cvttps_epi32(gx), sy = _mm256_cvttps_epi32(gy);
    const __m256i ix = _mm256_and_si256(_mm256_add_epi32(_mm256_srli_epi32(sx, kSubcellBits), first_x), mask);
    const __m256i iy = _mm256_and_si256(_mm256_add_epi32(_mm256_srli_epi32(sy, kSubcellBits), first_y), mask);
    const __m256i quad =
        _mm256_i32gather_epi32(quads, _mm256_add_epi32(_mm256_mullo_epi32(iy, stride), ix), 4);
    // Shares along x as bytes [255 - t, t, 255 - t, t], along y as words [255 - t, t]; 255 - t = t ^ 255.
    const __m256i share_x = _mm256_xor_si256(_mm256_shuffle_epi8(sx, all_bytes), flip_x);
    const __m256i share_y = _mm256_xor_si256(_mm256_shuffle_epi8(sy, both_words), flip_y);
    const __m256i missing = _mm256_cmpeq_epi8(quad, unknown);
    const __m256i value =
        _mm256_madd_epi16(_mm256_maddubs_epi16(share_x, _mm256_andnot_si256(missing, quad)), share_y);
    __m256 cost = _mm256_cvtepi32_ps(_mm256_abs_epi32(value));
    if (!_mm256_testz_si256(missing, missing)) {
      const __m256i lost = _mm256_madd_epi16(
          _mm256_maddubs_epi16(share_x, _mm256_and_si256(missing, _mm256_set1_epi8(1))), share_y);
      cost = _mm256_add_ps(cost, _mm256_mul_ps(_mm256_cvtepi32_ps(lost), price));
    }
    if (!kInside) cost = _mm256_blendv_ps(_mm256_set1_ps(w.off_window), cost, inside);
    sum = _mm256_add_ps(sum, _mm256_mul_ps(_mm256_loadu_ps(&points.weight[k]), cost));
  }
  _mm256_storeu_ps(lane, sum);
  return k;
}
#endif

float sum_of_costs(const Window& window, const ScaledPose& pose, const WeightedPoints& points, float reach,
                   bool vectors) {
  float lane[8] = {};
  std::size_t done = 0;
#ifdef KNAV_HAVE_AVX2_CODE
  if (vectors) {
    const bool inside = pose.x0 - reach >= 0.0f && pose.y0 - reach >= 0.0f && pose.x0 + reach < window.last &&
                        pose.y0 + reach < window.last;
    done = inside ? add_costs_avx2<true>(window, pose, points, lane)
                  : add_costs_avx2<false>(window, pose, points, lane);
  }
#endif
  add_costs(window, pose, points, done, points.size(), lane);
  return ((lane[0] + lane[4]) + (lane[1] + lane[5])) + ((lane[2] + lane[6]) + (lane[3] + lane[7]));
}

}  // namespace

void tsdf_alignment_costs(const TsdfGrid& grid, const WeightedPoints& points, const ParticleSet& particles,
                          float unknown_price, std::vector<float>* cost, int threads, bool vectors) {
  cost->resize(particles.size());
  float weight_sum = 0.0f, reach_m = 0.0f;
  for (std::size_t k = 0; k < points.size(); ++k) {
    weight_sum += points.weight[k];
    reach_m = std::max(reach_m, std::fabs(points.x_m[k]) + std::fabs(points.y_m[k]));
  }
  constexpr float kUnit = TsdfGrid::kValueScale * static_cast<float>(kShares);
  const float to_mean = weight_sum > 0.0f ? 1.0f / (kUnit * weight_sum) : 0.0f;
  const int mask = grid.size_cells() - 1;
  const Window window{grid.quads(),
                      grid.quad_stride(),
                      mask,
                      grid.first_x() & mask,
                      grid.first_y() & mask,
                      kSubcells * static_cast<float>(mask),
                      unknown_price * TsdfGrid::kValueScale,
                      unknown_price * kUnit};
  const double scale = 1.0 / grid.resolution_m();
  const float reach = kSubcells * (reach_m * static_cast<float>(scale) + 1.0f);
  static thread_local std::vector<double> cosine, sine;
  cosine.resize(particles.size());
  sine.resize(particles.size());
  cos_sin(particles.yaw_rad.data(), particles.size(), cosine.data(), sine.data());
  const bool use_vectors = vectors && cpu_has_avx2();
  const double *const cosines = cosine.data(), *const sines = sine.data();  // this thread's
  in_parts(particles.size(), threads, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      ScaledPose pose;
      pose.x0 = static_cast<float>((particles.x_m[i] * scale - 0.5 - grid.first_x()) * kSubcells);
      pose.y0 = static_cast<float>((particles.y_m[i] * scale - 0.5 - grid.first_y()) * kSubcells);
      pose.c = static_cast<float>(cosines[i] * scale * kSubcells);
      pose.s = static_cast<float>(sines[i] * scale * kSubcells);
      (*cost)[i] = sum_of_costs(window, pose, points, reach, use_vectors) * to_mean;
    }
  });
}

void weigh_by_known_share(const TsdfGrid& grid, const ParticleSet& particles, int hypotheses,
                          WeightedPoints* points) {
  const std::size_t count = std::min(particles.size(), static_cast<std::size_t>(std::max(1, hypotheses)));
  static thread_local std::vector<float> seen;
  seen.assign(points->size(), 0.0f);
  for (std::size_t h = 0; h < count; ++h) {
    const Pose2 T = particles.pose(h * particles.size() / count);
    const double c = std::cos(T.yaw_rad), s = std::sin(T.yaw_rad);
    for (std::size_t k = 0; k < points->size(); ++k) {
      const double x = points->x_m[k], y = points->y_m[k];
      const int ix = grid.cell_of(T.x_m + c * x - s * y), iy = grid.cell_of(T.y_m + s * x + c * y);
      if (grid.contains(ix, iy) && grid.known(ix, iy)) seen[k] += 1.0f;
    }
  }
  for (std::size_t k = 0; k < points->size(); ++k) {
    const float share = seen[k] / static_cast<float>(count);
    points->weight[k] *= share * share;
  }
}

void tsdf_paper_costs(const TsdfGrid& grid, const WeightedPoints& points, const ParticleSet& particles,
                      std::vector<float>* cost, float* mean_weight) {
  cost->resize(particles.size());
  const double unit = grid.weight_unit();
  double weight_sum = 0.0, known = 0.0;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const Pose2 T = particles.pose(i);
    const double c = std::cos(T.yaw_rad), s = std::sin(T.yaw_rad);
    double sum = 0.0;
    for (std::size_t k = 0; k < points.size(); ++k) {
      const double x = points.x_m[k], y = points.y_m[k];
      const int ix = grid.cell_of(T.x_m + c * x - s * y), iy = grid.cell_of(T.y_m + s * x + c * y);
      if (!grid.contains(ix, iy)) continue;
      const std::size_t cell = grid.index(ix, iy);
      sum += std::fabs(static_cast<double>(grid.weighted_sum_units(cell)));
      if (grid.weight_units(cell) > 0) {
        weight_sum += grid.weight_units(cell);
        known += 1.0;
      }
    }
    (*cost)[i] = static_cast<float>(sum / unit);
  }
  *mean_weight = known > 0.0 ? static_cast<float>(weight_sum / (known * unit)) : 0.0f;
}

}  // namespace knav
