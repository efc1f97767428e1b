#include "core/tsdf_row_avx2.h"

#ifdef KNAV_HAVE_AVX2_CODE

#include <immintrin.h>

#include <algorithm>

#include "core/tsdf_cell.h"

namespace knav {
namespace {

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

/// The columns that see eight neighbouring cells, and what the observation says of them. A gather costs many times a load;
/// where the columns lie within eight, as with a Kinect from 15 m on and nearer along its rays, a load and a permutation do.
class Columns8 {
 public:
  KNAV_AVX2 Columns8(const TsdfObservation& o, __m256i u) : u_(_mm256_max_epi32(u, _mm256_setzero_si256())) {
    // Columns fit into 16 bits: see eights().
    const __m128i words = _mm_packus_epi32(_mm256_castsi256_si128(u_), _mm256_extracti128_si256(u_, 1));
    first_ = _mm_extract_epi16(_mm_minpos_epu16(words), 0);
    last_ = 0xFFFF - _mm_extract_epi16(_mm_minpos_epu16(_mm_xor_si128(words, _mm_set1_epi16(-1))), 0);
    base_ = std::min(first_, static_cast<int>(o.columns()) - kLanes);
    close_ = base_ >= 0 && last_ - base_ < kLanes;
    lane_ = _mm256_sub_epi32(u_, _mm256_set1_epi32(base_));
  }
  KNAV_AVX2 __m256 operator()(const std::vector<float>& field) const {
    return close_ ? _mm256_permutevar8x32_ps(_mm256_loadu_ps(field.data() + base_), lane_)
                  : _mm256_i32gather_ps(field.data(), u_, 4);
  }
  KNAV_AVX2 __m256i operator()(const std::vector<std::int32_t>& field) const {
    return close_ ? _mm256_permutevar8x32_epi32(load8(field.data() + base_), lane_)
                  : _mm256_i32gather_epi32(field.data(), u_, 4);
  }
  /// True if all eight cells surely lie where their columns saw free space.
  KNAV_AVX2 bool surely_free(const TsdfObservation& o, __m256 d) const {
    if (last_ - first_ >= 4 * kLanes) return false;
    int begin = first_;
    float from_m = o.free_from_8_m[static_cast<std::size_t>(begin)], to_m = o.free_to_8_m[static_cast<std::size_t>(begin)];
    while (begin + kLanes <= last_) {
      begin = std::min(begin + kLanes, last_ - kLanes + 1);
      from_m = std::max(from_m, o.free_from_8_m[static_cast<std::size_t>(begin)]);
      to_m = std::min(to_m, o.free_to_8_m[static_cast<std::size_t>(begin)]);
    }
    const __m256 inside = _mm256_and_ps(_mm256_cmp_ps(d, _mm256_set1_ps(from_m), _CMP_GE_OQ),
                                        _mm256_cmp_ps(d, _mm256_set1_ps(to_m), _CMP_LE_OQ));
    return _mm256_movemask_ps(inside) == 0xFF;
  }

 private:
  static constexpr int kLanes = 8;
  __m256i u_, lane_;
  int first_, last_, base_;
  bool close_;
};

/// Equation 4 for eight cells, not yet rounded.
KNAV_AVX2 inline __m256 weight_of8(const TsdfRules& rules, __m256 d) {
  const __m256 floor2 = _mm256_set1_ps(rules.weight_range_floor_m * rules.weight_range_floor_m);
  return _mm256_div_ps(_mm256_set1_ps(rules.weight_unit), _mm256_max_ps(_mm256_mul_ps(d, d), floor2));
}
KNAV_AVX2 inline __m256i rounded8(__m256 weight) {
  return _mm256_cvttps_epi32(_mm256_add_ps(weight, _mm256_set1_ps(0.5f)));
}

/// part_of() for eight cells; operation by operation the same roundings.
struct Part8 {
  __m256i near_surface, carved, before_free, weight, deficit;
  __m256 f;
};

KNAV_AVX2 inline Part8 part_of8(const TsdfRules& rules, const TsdfObservation& o, const Columns8& of_column, __m256 d) {
  Part8 part;
  const __m256 one = _mm256_set1_ps(1.0f), zero = _mm256_setzero_ps();
  const __m256 eta = _mm256_sub_ps(of_column(o.range_m), d);
  const __m256 f = _mm256_mul_ps(eta, of_column(o.inverse_truncation_per_m));
  const __m256 behind_limit = o.any_edge ? of_column(o.behind_limit) : _mm256_set1_ps(-1.0f);
  const __m256 front_limit = o.any_cut ? of_column(o.front_limit) : one;
  const __m256 near_surface =
      _mm256_and_ps(_mm256_cmp_ps(f, behind_limit, _CMP_GE_OQ), _mm256_cmp_ps(f, front_limit, _CMP_LT_OQ));
  const __m256 free_from = of_column(o.free_from_m);
  const __m256 carved = _mm256_andnot_ps(
      near_surface, _mm256_and_ps(_mm256_cmp_ps(d, free_from, _CMP_GE_OQ),
                                  _mm256_cmp_ps(d, of_column(o.free_to_m), _CMP_LE_OQ)));
  part.f = _mm256_blendv_ps(one, f, near_surface);
  __m256 weight = weight_of8(rules, d);
  const __m256 behind = _mm256_cmp_ps(part.f, zero, _CMP_LT_OQ);
  if (_mm256_movemask_ps(behind) != 0) {
    __m256 share = _mm256_mul_ps(_mm256_add_ps(one, part.f), _mm256_set1_ps(o.behind_slope));
    share = _mm256_min_ps(share, one);
    __m256 less = weight;
    for (int power = 0; power < o.behind_power; ++power) less = _mm256_mul_ps(less, share);
    less = _mm256_max_ps(less, one);
    weight = _mm256_blendv_ps(weight, less, behind);
  }
  part.weight = rounded8(weight);
  const __m256 half = _mm256_set1_ps(0.5f), sign = _mm256_set1_ps(-0.0f);
  const __m256 product = _mm256_mul_ps(part.f, _mm256_cvtepi32_ps(part.weight));
  const __m256 down = _mm256_cmp_ps(product, zero, _CMP_LT_OQ);
  const __m256 rounding = _mm256_or_ps(half, _mm256_and_ps(down, sign));
  part.deficit = _mm256_sub_epi32(part.weight, _mm256_cvttps_epi32(_mm256_add_ps(product, rounding)));
  part.near_surface = _mm256_castps_si256(near_surface);
  part.carved = _mm256_castps_si256(carved);
  part.before_free = _mm256_castps_si256(_mm256_cmp_ps(d, free_from, _CMP_LT_OQ));
  return part;
}

/// value_of() for eight cells, as eight bytes.
KNAV_AVX2 inline std::uint64_t values_of8(__m256i deficit, __m256i weight) {
  const __m256i known = _mm256_cmpgt_epi32(weight, _mm256_setzero_si256());
  if (_mm256_testz_si256(deficit, deficit) && _mm256_movemask_epi8(known) == -1) {
    constexpr auto kFree = static_cast<std::uint64_t>(TsdfGrid::kValueScale);
    return 0x0101010101010101u * kFree;
  }
  const __m256i weighted_sum = _mm256_sub_epi32(weight, deficit);
  const __m256 scaled = _mm256_mul_ps(_mm256_set1_ps(TsdfGrid::kValueScale), _mm256_cvtepi32_ps(weighted_sum));
  const __m256 f = _mm256_div_ps(scaled, _mm256_cvtepi32_ps(weight));
  const __m256 down = _mm256_cmp_ps(f, _mm256_setzero_ps(), _CMP_LT_OQ);
  const __m256 rounding = _mm256_or_ps(_mm256_set1_ps(0.5f), _mm256_and_ps(down, _mm256_set1_ps(-0.0f)));
  const __m256i rounded = _mm256_cvttps_epi32(_mm256_add_ps(f, rounding));
  const __m256i value = _mm256_blendv_epi8(_mm256_set1_epi32(TsdfGrid::kUnknown), rounded, known);
  const __m128i words = _mm_packs_epi32(_mm256_castsi256_si128(value), _mm256_extracti128_si256(value, 1));
  return static_cast<std::uint64_t>(_mm_cvtsi128_si64(_mm_packs_epi16(words, words)));
}

KNAV_AVX2 inline void store_values(std::uint64_t value, int k, const TsdfCells& cells, TsdfChange* change) {
  if (value == bytes8(cells.value + k)) return;
  __builtin_memcpy(cells.value + k, &value, 8);
  change->add(k);
  change->add(k + 7);
}

/// Which of eight cells hold a surface.
KNAV_AVX2 inline __m256i surfaces8(__m256i held) {
  return _mm256_and_si256(_mm256_cmpgt_epi32(_mm256_set1_epi32(kSupport), held),
                          _mm256_cmpgt_epi32(held, _mm256_set1_epi32(TsdfGrid::kUnknown)));
}

/// Adds the standing weight of near cells, or takes it away.
template <bool kAdd>
KNAV_AVX2 inline void change_standing(const TsdfObservation& o, const Columns8& of_column, __m256i near_seen, __m256i weight,
                                      std::int32_t* standing_weight) {
  if (_mm256_testz_si256(near_seen, near_seen)) return;
  const __m256i change = _mm256_and_si256(weight, _mm256_and_si256(near_seen, of_column(o.standing)));
  const __m256i old = load8(standing_weight);
  store8(standing_weight, kAdd ? _mm256_add_epi32(old, change) : _mm256_sub_epi32(old, change));
}

/// Columns8 wants columns that fit into 16 bits.
int eights(const TsdfObservation& o, int count) { return o.columns() <= 0xFFFF ? count - count % 8 : 0; }

}  // namespace

int add_to_cells_avx2(const TsdfRules& rules, const TsdfObservation& o, const std::int32_t* column,
                      const float* distance_m, int count, const TsdfCells& cells, TsdfChange* change,
                      std::uint64_t* contradicted) {
  const __m256 age = _mm256_set1_ps(o.age_clock_s);
  const float appear_to_m = o.any_standing ? rules.low_appear_to_m : rules.appear_to_m;
  const float appear_contrast = o.any_standing ? kLowContrast : kFrontContrast;
  const int whole = eights(o, count);
  for (int k = 0; k < whole; k += 8) {
    const __m256i u = load8(column + k);
    const __m256i seen = _mm256_cmpgt_epi32(u, _mm256_set1_epi32(-1));
    if (_mm256_testz_si256(seen, seen)) continue;
    const __m256 d = _mm256_loadu_ps(distance_m + k);
    const Columns8 of_column(o, u);
    // Cells with a surface that might be contradicted, or were, are rare: one by one.
    const __m256i held = _mm256_cvtepi8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(cells.value + k)));
    const __m256i surface = surfaces8(held);
    const bool calm = bytes8(cells.contradictions + k) == 0;
    if (calm && _mm256_testz_si256(surface, surface) && _mm256_movemask_epi8(seen) == -1 && of_column.surely_free(o, d)) {
      const __m256i weight = _mm256_add_epi32(load8(cells.weight + k), rounded8(weight_of8(rules, d)));
      store8(cells.weight + k, weight);
      _mm256_storeu_ps(cells.last_seen_s + k, age);
      store_values(values_of8(load8(cells.deficit + k), weight), k, cells, change);
      continue;
    }
    const Part8 part = part_of8(rules, o, of_column, d);
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
    const __m256i near_seen = _mm256_and_si256(part.near_surface, seen);
    const __m256i come = _mm256_and_si256(_mm256_and_si256(freer, near_enough), near_seen);
    const __m256i doubtful = _mm256_or_si256(gone, come);
    if (!calm || !_mm256_testz_si256(doubtful, doubtful)) {
      for (int j = k; j < k + 8; ++j)
        add_to_cell(rules, o, column, distance_m, j, cells, change, contradicted);
      continue;
    }
    if (_mm256_testz_si256(touched, touched)) continue;
    const __m256i dw = _mm256_and_si256(part.weight, touched);
    const __m256i deficit =
        _mm256_add_epi32(load8(cells.deficit + k), _mm256_and_si256(part.deficit, touched));
    const __m256i weight = _mm256_add_epi32(load8(cells.weight + k), dw);
    store8(cells.deficit + k, deficit);
    store8(cells.weight + k, weight);
    _mm256_maskstore_ps(cells.last_seen_s + k, touched, age);
    if (o.any_standing) change_standing<true>(o, of_column, near_seen, dw, cells.standing_weight + k);
    store_values(values_of8(deficit, weight), k, cells, change);
  }
  return whole;
}

int remove_from_cells_avx2(const TsdfRules& rules, const TsdfObservation& o, const std::int32_t* column,
                           const float* distance_m, int count, const TsdfCells& cells, TsdfChange* change) {
  const __m256i sequence = _mm256_set1_epi32(static_cast<int>(o.sequence));
  const int whole = eights(o, count);
  for (int k = 0; k < whole; k += 8) {
    const __m256i u = load8(column + k);
    const __m256i seen = _mm256_andnot_si256(_mm256_cmpgt_epi32(load8(cells.reset + k), sequence),
                                             _mm256_cmpgt_epi32(u, _mm256_set1_epi32(-1)));
    if (_mm256_testz_si256(seen, seen)) continue;
    const __m256 d = _mm256_loadu_ps(distance_m + k);
    const Columns8 of_column(o, u);
    if (_mm256_movemask_epi8(seen) == -1 && of_column.surely_free(o, d)) {
      const __m256i weight = _mm256_sub_epi32(load8(cells.weight + k), rounded8(weight_of8(rules, d)));
      store8(cells.weight + k, weight);
      store_values(values_of8(load8(cells.deficit + k), weight), k, cells, change);
      continue;
    }
    const Part8 part = part_of8(rules, o, of_column, d);
    const __m256i touched = _mm256_and_si256(seen, _mm256_or_si256(part.near_surface, part.carved));
    if (_mm256_testz_si256(touched, touched)) continue;
    const __m256i dw = _mm256_and_si256(part.weight, touched);
    const __m256i deficit =
        _mm256_sub_epi32(load8(cells.deficit + k), _mm256_and_si256(part.deficit, touched));
    const __m256i weight = _mm256_sub_epi32(load8(cells.weight + k), dw);
    store8(cells.deficit + k, deficit);
    store8(cells.weight + k, weight);
    if (o.any_standing) {
      change_standing<false>(o, of_column, _mm256_and_si256(part.near_surface, seen), dw, cells.standing_weight + k);
    }
    store_values(values_of8(deficit, weight), k, cells, change);
  }
  return whole;
}

}  // namespace knav

#endif
