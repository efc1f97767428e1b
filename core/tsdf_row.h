#pragma once

#include <cstdint>

#include "core/tsdf_observation.h"

namespace knav {

/// The part of a row of cells that lies in one piece in memory; a pointer each to its first cell.
struct TsdfCells {
  /// Sum of w minus sum of w f, by which the sum of w f is kept: free space, most of what a frame sees, adds nothing to it.
  std::uint32_t* deficit;
  std::int32_t* weight;
  std::int32_t* standing_weight;  ///< the share of `weight` that surfaces of low or high things gave
  std::uint32_t* reset;
  float* last_seen_s;
  std::uint8_t* contradictions;
  std::int8_t* value;
};

/// The sum of w f.
inline std::int32_t weighted_sum_of(std::uint32_t deficit, std::int32_t weight) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(weight) - deficit);
}

/// What integrating needs besides the observation.
struct TsdfRules {
  float weight_unit = 0.0f;
  float weight_range_floor_m = 0.0f;
  float resolution_m = 0.0f;
  int contradictions_to_reset = 0;
  float middle_clear_from_m = 0.0f;  ///< nearer than this even a middle thing is out of view
  float standing_clear_to_m = 0.0f;  ///< beyond this a low thing is no longer seen
  float front_clear_to_m = 0.0f;     ///< see TsdfConfig::front_clear_range_m
  float appear_to_m = 0.0f;          ///< see TsdfConfig::appear_range_m
  float low_appear_to_m = 0.0f;      ///< the same for low things, at least appear_to_m
  bool vectors = true;
};

/// Whether what a cell holds is taken for a low or high thing, which leaves the view as one comes near: a quarter of its
/// weight comes from such readings, or as much as eight of them give from 2 m off. Somebody who walks past a box on the
/// floor, or stands before it, does not take it with him.
inline bool is_standing(std::int32_t standing_weight, std::int32_t weight, float weight_unit) {
  return 4 * static_cast<std::int64_t>(standing_weight) >= weight || static_cast<float>(standing_weight) >= 2.0f * weight_unit;
}

/// Which cells changed their value: a range, or none.
struct TsdfChange {
  int first = 1 << 30, last = -(1 << 30);
  bool empty() const { return first > last; }
  void add(int k) {
    if (k < first) first = k;
    if (k > last) last = k;
  }
};

/// Adds the observation to, or removes it from, cells [0, count) of a row (equations 2-6, 8, 9).
/// @param column      the observation's column that sees cell k, or -1
/// @param distance_m  of its centre from the sensor
/// @param contradicted  receives how many cells were reset
/// The same bytes with and without vectors.
TsdfChange add_to_cells(const TsdfRules& rules, const TsdfObservation& observation,
                        const std::int32_t* column, const float* distance_m, int count,
                        const TsdfCells& cells, std::uint64_t* contradicted);
TsdfChange remove_from_cells(const TsdfRules& rules, const TsdfObservation& observation,
                             const std::int32_t* column, const float* distance_m, int count,
                             const TsdfCells& cells);

}  // namespace knav
