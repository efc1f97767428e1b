#include "core/tsdf_row.h"

#include "core/multiversion.h"
#include "core/tsdf_grid.h"

#ifdef KNAV_HAVE_AVX2_CODE
#include <immintrin.h>
#endif

namespace knav {
namespace {

constexpr std::int8_t kSupport = 76;        ///< 0.6: cells below this have a surface near
constexpr std::int8_t kFrontContrast = 76;  ///< by this much a cell must be freer than it was known to be
/// A reading's own surface: not its hidden side, where a wall may end whose other face is seen from another room. A low
/// thing that is seen along its edge shows itself at sharp angles only, so that its inside has to count.
constexpr float kOwnBehind = -0.2f, kOwnBehindLow = -0.75f, kOwnFront = 0.3f;
/// Rays that missed a low thing from afar, where it is not seen well, called it half free: so much less has to differ at its face.
constexpr std::int8_t kLowContrast = 32;
constexpr float kFaceBehindLow = -0.3f;

std::int8_t value_of(std::int32_t weighted_sum, std::int32_t weight) {
  if (weight <= 0) return TsdfGrid::kUnknown;
  const float f = TsdfGrid::kValueScale * static_cast<float>(weighted_sum) / static_cast<float>(weight);
  return static_cast<std::int8_t>(f + (f < 0.0f ? -0.5f : 0.5f));
}

/// What an observation says of a cell.
struct Part {
  bool near_surface, carved;
  float f;  ///< equation 2: min(1, |eta| / mu) sgn(eta)
  std::int32_t weight, weighted;
};

inline Part part_of(const TsdfRules& rules, const TsdfObservation& o, std::size_t u, float d) {
  Part part;
  const float eta = o.range_m[u] - d;  // NaN without a surface
  const float f = eta * o.inverse_truncation_per_m[u];
  part.near_surface = f >= o.behind_limit[u] && f < o.front_limit[u];
  part.carved = !part.near_surface && d >= o.free_from_m[u] && d <= o.free_to_m[u];
  part.f = part.near_surface ? f : 1.0f;
  const float floor2 = rules.weight_range_floor_m * rules.weight_range_floor_m;
  const float square = d * d > floor2 ? d * d : floor2;
  float weight = rules.weight_unit / square;  // equation 4
  if (part.f < 0.0f) {
    float share = (1.0f + part.f) * o.behind_slope;
    share = share < 1.0f ? share : 1.0f;
    for (int power = 0; power < o.behind_power; ++power) weight *= share;
    weight = weight < 1.0f ? 1.0f : weight;  // stays known
  }
  part.weight = static_cast<std::int32_t>(weight + 0.5f);
  const float product = part.f * static_cast<float>(part.weight);
  part.weighted = static_cast<std::int32_t>(product + (product < 0.0f ? -0.5f : 0.5f));
  return part;
}

/// Whether the cell holds a surface that this observation sees through. Surfaces of middle height stay in
/// view down to middle_clear_from_m, so the blind zone's lower end does not protect them; low and high ones
/// it does.
inline bool contradicts(const TsdfRules& rules, const TsdfObservation& o, std::size_t u, float d,
                        const Part& part, std::int8_t held, bool standing) {
  if (held == TsdfGrid::kUnknown || held >= kSupport) return false;
  if (!(d > o.clear_from_m[u] && d + 2.0f * rules.resolution_m < o.clear_to_m[u])) return false;
  if (part.carved) return !standing || d <= rules.standing_clear_to_m;
  if (standing || d < rules.middle_clear_from_m || o.free_to_m[u] < o.free_from_m[u]) return false;
  if (!part.near_surface) return d < o.free_from_m[u];
  return d <= rules.front_clear_to_m && held <= 0 &&
         TsdfGrid::kValueScale * part.f - static_cast<float>(held) > static_cast<float>(kFrontContrast);
}

/// Whether the observation shows a surface in a cell that was known to be free. Near the robot that must count at once:
/// closer still, a depth camera sees nothing of it, and what the map did not take in by then would be driven into. That
/// holds from farther away for low things: from where the cell was called free, they could not be seen.
inline bool appears(const TsdfRules& rules, const TsdfObservation& o, std::size_t u, float d, const Part& part,
                    std::int8_t held) {
  const bool low = o.standing[u] != 0;
  const std::int8_t contrast = low && part.f >= kFaceBehindLow ? kLowContrast : kFrontContrast;
  return part.near_surface && d <= (low ? rules.low_appear_to_m : rules.appear_to_m) &&
         part.f >= (low ? kOwnBehindLow : kOwnBehind) && part.f <= kOwnFront &&
         held != TsdfGrid::kUnknown &&
         static_cast<float>(held) - TsdfGrid::kValueScale * part.f > static_cast<float>(contrast);
}

inline void add_to_cell(const TsdfRules& rules, const TsdfObservation& o, const std::int32_t* column,
                        const float* distance_m, int k, const TsdfCells& cells, TsdfChange* change,
                        std::uint64_t* contradicted) {
  if (column[k] < 0) return;
  const auto u = static_cast<std::size_t>(column[k]);
  const float d = distance_m[k];
  const Part part = part_of(rules, o, u, d);
  const bool standing = is_standing(cells.standing_weight[k], cells.weight[k], rules.weight_unit);
  const std::int8_t held = cells.value[k];
  if (contradicts(rules, o, u, d, part, held, standing) || appears(rules, o, u, d, part, held)) {
    if (++cells.contradictions[k] >= rules.contradictions_to_reset) {
      cells.weighted_sum[k] = cells.weight[k] = cells.standing_weight[k] = 0;
      cells.reset[k] = o.sequence;
      cells.contradictions[k] = 0;
      ++*contradicted;
    }
  } else if (part.near_surface || (part.carved && held >= kSupport)) {
    cells.contradictions[k] = 0;
  }
  if (part.near_surface || part.carved) {
    cells.weighted_sum[k] += part.weighted;
    cells.weight[k] += part.weight;
    if (part.near_surface && o.standing[u] != 0) cells.standing_weight[k] += part.weight;
    cells.last_seen_s[k] = o.age_clock_s;
  }
  const std::int8_t value = value_of(cells.weighted_sum[k], cells.weight[k]);
  if (value == cells.value[k]) return;
  cells.value[k] = value;
  change->add(k);
}

inline void remove_from_cell(const TsdfRules& rules, const TsdfObservation& o, const std::int32_t* column,
                             const float* distance_m, int k, const TsdfCells& cells, TsdfChange* change) {
  if (column[k] < 0 || cells.reset[k] > o.sequence) return;
  const auto u = static_cast<std::size_t>(column[k]);
  const Part part = part_of(rules, o, u, distance_m[k]);
  if (!part.near_surface && !part.carved) return;
  cells.weighted_sum[k] -= part.weighted;
  cells.weight[k] -= part.weight;
  if (part.near_surface && o.standing[u] != 0) cells.standing_weight[k] -= part.weight;
  const std::int8_t value = value_of(cells.weighted_sum[k], cells.weight[k]);
  if (value == cells.value[k]) return;
  cells.value[k] = value;
  change->add(k);
}

#ifdef KNAV_HAVE_AVX2_CODE

/// part_of() for eight cells; operation by operation the same roundings.
struct Part8 {
  __m256i near_surface, carved, before_free, weight, weighted;
  __m256 f;
};

KNAV_AVX2 inline Part8 part_of8(const TsdfRules& rules, const TsdfObservation& o, __m256i u, __m256 d) {
  Part8 part;
  const __m256 one = _mm256_set1_ps(1.0f), zero = _mm256_setzero_ps();
  const __m256 eta = _mm256_sub_ps(_mm256_i32gather_ps(o.range_m.data(), u, 4), d);
  const __m256 f = _mm256_mul_ps(eta, _mm256_i32gather_ps(o.inverse_truncation_per_m.data(), u, 4));
  const __m256 behind_limit = o.any_edge ? _mm256_i32gather_ps(o.behind_limit.data(), u, 4) : _mm256_set1_ps(-1.0f);
  const __m256 front_limit = o.any_cut ? _mm256_i32gather_ps(o.front_limit.data(), u, 4) : one;
  const __m256 near_surface =
      _mm256_and_ps(_mm256_cmp_ps(f, behind_limit, _CMP_GE_OQ), _mm256_cmp_ps(f, front_limit, _CMP_LT_OQ));
  const __m256 free_from = _mm256_i32gather_ps(o.free_from_m.data(), u, 4);
  const __m256 carved = _mm256_andnot_ps(
      near_surface,
      _mm256_and_ps(_mm256_cmp_ps(d, free_from, _CMP_GE_OQ),
                    _mm256_cmp_ps(d, _mm256_i32gather_ps(o.free_to_m.data(), u, 4), _CMP_LE_OQ)));
  part.f = _mm256_blendv_ps(one, f, near_surface);
  const __m256 floor2 = _mm256_set1_ps(rules.weight_range_floor_m * rules.weight_range_floor_m);
  const __m256 square = _mm256_max_ps(_mm256_mul_ps(d, d), floor2);
  __m256 weight = _mm256_div_ps(_mm256_set1_ps(rules.weight_unit), square);
  const __m256 behind = _mm256_cmp_ps(part.f, zero, _CMP_LT_OQ);
  if (_mm256_movemask_ps(behind) != 0) {
    __m256 share = _mm256_mul_ps(_mm256_add_ps(one, part.f), _mm256_set1_ps(o.behind_slope));
    share = _mm256_min_ps(share, one);
    __m256 less = weight;
    for (int power = 0; power < o.behind_power; ++power) less = _mm256_mul_ps(less, share);
    less = _mm256_max_ps(less, one);
    weight = _mm256_blendv_ps(weight, less, behind);
  }
  const __m256 half = _mm256_set1_ps(0.5f), sign = _mm256_set1_ps(-0.0f);
  part.weight = _mm256_cvttps_epi32(_mm256_add_ps(weight, half));
  const __m256 product = _mm256_mul_ps(part.f, _mm256_cvtepi32_ps(part.weight));
  const __m256 down = _mm256_cmp_ps(product, zero, _CMP_LT_OQ);
  const __m256 rounding = _mm256_or_ps(half, _mm256_and_ps(down, sign));
  part.weighted = _mm256_cvttps_epi32(_mm256_add_ps(product, rounding));
  part.near_surface = _mm256_castps_si256(near_surface);
  part.carved = _mm256_castps_si256(carved);
  part.before_free = _mm256_castps_si256(_mm256_cmp_ps(d, free_from, _CMP_LT_OQ));
  return part;
}

/// value_of() for eight cells, as eight bytes.
KNAV_AVX2 inline std::uint64_t values_of8(__m256i weighted_sum, __m256i weight) {
  const __m256 scaled =
      _mm256_mul_ps(_mm256_set1_ps(TsdfGrid::kValueScale), _mm256_cvtepi32_ps(weighted_sum));
  const __m256 f = _mm256_div_ps(scaled, _mm256_cvtepi32_ps(weight));
  const __m256 down = _mm256_cmp_ps(f, _mm256_setzero_ps(), _CMP_LT_OQ);
  const __m256 rounding = _mm256_or_ps(_mm256_set1_ps(0.5f), _mm256_and_ps(down, _mm256_set1_ps(-0.0f)));
  const __m256i rounded = _mm256_cvttps_epi32(_mm256_add_ps(f, rounding));
  const __m256i known = _mm256_cmpgt_epi32(weight, _mm256_setzero_si256());
  const __m256i value = _mm256_blendv_epi8(_mm256_set1_epi32(TsdfGrid::kUnknown), rounded, known);
  const __m128i words = _mm_packs_epi32(_mm256_castsi256_si128(value), _mm256_extracti128_si256(value, 1));
  return static_cast<std::uint64_t>(_mm_cvtsi128_si64(_mm_packs_epi16(words, words)));
}

template <class T>
KNAV_AVX2 inline __m256i load8(const T* p) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p));
}
template <class T>
KNAV_AVX2 inline void store8(T* p, __m256i v) {
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(p), v);
}
inline std::uint64_t bytes8(const void* p) {
  std::uint64_t bytes;
  __builtin_memcpy(&bytes, p, 8);
  return bytes;
}

KNAV_AVX2 inline void store_values(std::uint64_t value, int k, const TsdfCells& cells, TsdfChange* change) {
  if (value == bytes8(cells.value + k)) return;
  __builtin_memcpy(cells.value + k, &value, 8);
  change->add(k);
  change->add(k + 7);
}

/// Whole groups of eight; returns how many cells it has done.
KNAV_AVX2 int add_to_cells_avx2(const TsdfRules& rules, const TsdfObservation& o, const std::int32_t* column,
                                const float* distance_m, int count, const TsdfCells& cells,
                                TsdfChange* change, std::uint64_t* contradicted) {
  const __m256 age = _mm256_set1_ps(o.age_clock_s);
  const float appear_to_m = o.any_standing ? rules.low_appear_to_m : rules.appear_to_m;
  const float appear_contrast = o.any_standing ? kLowContrast : kFrontContrast;
  int k = 0;
  for (; k + 8 <= count; k += 8) {
    const __m256i u = load8(column + k);
    const __m256i seen = _mm256_cmpgt_epi32(u, _mm256_set1_epi32(-1));
    if (_mm256_testz_si256(seen, seen)) continue;
    const __m256 d = _mm256_loadu_ps(distance_m + k);
    const Part8 part = part_of8(rules, o, _mm256_max_epi32(u, _mm256_setzero_si256()), d);
    // Cells with a surface that might be contradicted, or were, are rare: one by one.
    const __m128i held8 = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(cells.value + k));
    const __m256i held = _mm256_cvtepi8_epi32(held8);
    const __m256i surface = _mm256_and_si256(_mm256_cmpgt_epi32(_mm256_set1_epi32(kSupport), held),
                                             _mm256_cmpgt_epi32(held, _mm256_set1_epi32(TsdfGrid::kUnknown)));
    const __m256 contrast =
        _mm256_sub_ps(_mm256_mul_ps(_mm256_set1_ps(TsdfGrid::kValueScale), part.f), _mm256_cvtepi32_ps(held));
    const __m256i agrees = _mm256_andnot_si256(
        _mm256_castps_si256(_mm256_cmp_ps(contrast, _mm256_set1_ps(kFrontContrast), _CMP_GT_OQ)),
        part.near_surface);
    const __m256i touched = _mm256_and_si256(seen, _mm256_or_si256(part.near_surface, part.carved));
    const __m256i concerned = _mm256_or_si256(touched, _mm256_and_si256(part.before_free, seen));
    const __m256i gone = _mm256_and_si256(_mm256_andnot_si256(agrees, surface), concerned);
    const __m256i freer = _mm256_castps_si256(
        _mm256_cmp_ps(contrast, _mm256_set1_ps(-appear_contrast), _CMP_LT_OQ));
    const __m256i near_enough =
        _mm256_castps_si256(_mm256_cmp_ps(d, _mm256_set1_ps(appear_to_m), _CMP_LE_OQ));
    const __m256i come =
        _mm256_and_si256(_mm256_and_si256(freer, near_enough), _mm256_and_si256(part.near_surface, seen));
    const __m256i doubtful = _mm256_or_si256(gone, come);
    if (!_mm256_testz_si256(doubtful, doubtful) || bytes8(cells.contradictions + k) != 0) {
      for (int j = k; j < k + 8; ++j)
        add_to_cell(rules, o, column, distance_m, j, cells, change, contradicted);
      continue;
    }
    if (_mm256_testz_si256(touched, touched)) continue;
    const __m256i dw = _mm256_and_si256(part.weight, touched);
    const __m256i sum =
        _mm256_add_epi32(load8(cells.weighted_sum + k), _mm256_and_si256(part.weighted, touched));
    const __m256i weight = _mm256_add_epi32(load8(cells.weight + k), dw);
    store8(cells.weighted_sum + k, sum);
    store8(cells.weight + k, weight);
    _mm256_maskstore_ps(cells.last_seen_s + k, touched, age);
    if (o.any_standing) {
      const __m256i near_seen = _mm256_and_si256(part.near_surface, seen);
      if (!_mm256_testz_si256(near_seen, near_seen)) {
        const __m256i mask = _mm256_and_si256(
            near_seen,
            _mm256_i32gather_epi32(o.standing.data(), _mm256_max_epi32(u, _mm256_setzero_si256()), 4));
        store8(cells.standing_weight + k,
               _mm256_add_epi32(load8(cells.standing_weight + k), _mm256_and_si256(dw, mask)));
      }
    }
    store_values(values_of8(sum, weight), k, cells, change);
  }
  return k;
}

KNAV_AVX2 int remove_from_cells_avx2(const TsdfRules& rules, const TsdfObservation& o,
                                     const std::int32_t* column, const float* distance_m, int count,
                                     const TsdfCells& cells, TsdfChange* change) {
  const __m256i sequence = _mm256_set1_epi32(static_cast<int>(o.sequence));
  int k = 0;
  for (; k + 8 <= count; k += 8) {
    const __m256i u = load8(column + k);
    const __m256i seen = _mm256_andnot_si256(_mm256_cmpgt_epi32(load8(cells.reset + k), sequence),
                                             _mm256_cmpgt_epi32(u, _mm256_set1_epi32(-1)));
    if (_mm256_testz_si256(seen, seen)) continue;
    const __m256i safe_u = _mm256_max_epi32(u, _mm256_setzero_si256());
    const Part8 part = part_of8(rules, o, safe_u, _mm256_loadu_ps(distance_m + k));
    const __m256i touched = _mm256_and_si256(seen, _mm256_or_si256(part.near_surface, part.carved));
    if (_mm256_testz_si256(touched, touched)) continue;
    const __m256i dw = _mm256_and_si256(part.weight, touched);
    const __m256i sum =
        _mm256_sub_epi32(load8(cells.weighted_sum + k), _mm256_and_si256(part.weighted, touched));
    const __m256i weight = _mm256_sub_epi32(load8(cells.weight + k), dw);
    store8(cells.weighted_sum + k, sum);
    store8(cells.weight + k, weight);
    if (o.any_standing) {
      const __m256i near_seen = _mm256_and_si256(part.near_surface, seen);
      if (!_mm256_testz_si256(near_seen, near_seen)) {
        const __m256i mask =
            _mm256_and_si256(near_seen, _mm256_i32gather_epi32(o.standing.data(), safe_u, 4));
        store8(cells.standing_weight + k,
               _mm256_sub_epi32(load8(cells.standing_weight + k), _mm256_and_si256(dw, mask)));
      }
    }
    store_values(values_of8(sum, weight), k, cells, change);
  }
  return k;
}

#endif

}  // namespace

TsdfChange add_to_cells(const TsdfRules& rules, const TsdfObservation& o, const std::int32_t* column,
                        const float* distance_m, int count, const TsdfCells& cells,
                        std::uint64_t* contradicted) {
  TsdfChange change;
  int k = 0;
#ifdef KNAV_HAVE_AVX2_CODE
  if (rules.vectors && cpu_has_avx2()) {
    k = add_to_cells_avx2(rules, o, column, distance_m, count, cells, &change, contradicted);
  }
#endif
  for (; k < count; ++k) add_to_cell(rules, o, column, distance_m, k, cells, &change, contradicted);
  return change;
}

TsdfChange remove_from_cells(const TsdfRules& rules, const TsdfObservation& o, const std::int32_t* column,
                             const float* distance_m, int count, const TsdfCells& cells) {
  TsdfChange change;
  int k = 0;
#ifdef KNAV_HAVE_AVX2_CODE
  if (rules.vectors && cpu_has_avx2()) {
    k = remove_from_cells_avx2(rules, o, column, distance_m, count, cells, &change);
  }
#endif
  for (; k < count; ++k) remove_from_cell(rules, o, column, distance_m, k, cells, &change);
  return change;
}

}  // namespace knav
