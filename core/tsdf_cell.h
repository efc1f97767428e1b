#pragma once

// What one observation says of one cell, and what that changes: the rules of add_to_cells() and remove_from_cells(), by which
// plain and vector code have to go alike.

#include <cstddef>
#include <cstdint>

#include "core/tsdf_grid.h"
#include "core/tsdf_row.h"

namespace knav {

constexpr std::int8_t kSupport = 76;        ///< 0.6: cells below this have a surface near
constexpr std::int8_t kFrontContrast = 76;  ///< by this much a cell must be freer than it was known to be
/// A reading's own surface: not its hidden side, where a wall may end whose other face is seen from another room. A low
/// thing that is seen along its edge shows itself at sharp angles only, so that its inside has to count.
constexpr float kOwnBehind = -0.2f, kOwnBehindLow = -0.75f, kOwnFront = 0.3f;
/// Rays that missed a low thing from afar, where it is not seen well, called it half free: so much less has to differ at its face.
constexpr std::int8_t kLowContrast = 32;
constexpr float kFaceBehindLow = -0.3f;

/// F of a cell as a signed byte.
inline std::int8_t value_of(std::uint32_t deficit, std::int32_t weight) {
  if (weight <= 0) return TsdfGrid::kUnknown;
  const float f = TsdfGrid::kValueScale * static_cast<float>(weighted_sum_of(deficit, weight)) / static_cast<float>(weight);
  return static_cast<std::int8_t>(f + (f < 0.0f ? -0.5f : 0.5f));
}

/// What an observation says of a cell.
struct Part {
  bool near_surface, carved;
  float f;  ///< equation 2: min(1, |eta| / mu) sgn(eta)
  std::int32_t weight;
  std::uint32_t deficit;  ///< the weight minus the weighted f: of free space none
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
  const auto weighted = static_cast<std::int32_t>(product + (product < 0.0f ? -0.5f : 0.5f));
  part.deficit = static_cast<std::uint32_t>(part.weight - weighted);
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
      cells.deficit[k] = 0;
      cells.weight[k] = cells.standing_weight[k] = 0;
      cells.reset[k] = o.sequence;
      cells.contradictions[k] = 0;
      ++*contradicted;
    }
  } else if (part.near_surface || (part.carved && held >= kSupport)) {
    cells.contradictions[k] = 0;
  }
  if (part.near_surface || part.carved) {
    cells.deficit[k] += part.deficit;
    cells.weight[k] += part.weight;
    if (part.near_surface && o.standing[u] != 0) cells.standing_weight[k] += part.weight;
    cells.last_seen_s[k] = o.age_clock_s;
  }
  const std::int8_t value = value_of(cells.deficit[k], cells.weight[k]);
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
  cells.deficit[k] -= part.deficit;
  cells.weight[k] -= part.weight;
  if (part.near_surface && o.standing[u] != 0) cells.standing_weight[k] -= part.weight;
  const std::int8_t value = value_of(cells.deficit[k], cells.weight[k]);
  if (value == cells.value[k]) return;
  cells.value[k] = value;
  change->add(k);
}

}  // namespace knav
