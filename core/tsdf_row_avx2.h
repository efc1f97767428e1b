#pragma once

#include <cstdint>

#include "core/multiversion.h"
#include "core/tsdf_row.h"

#ifdef KNAV_HAVE_AVX2_CODE

namespace knav {

/// add_to_cells() and remove_from_cells() for the whole groups of eight at the row's beginning; both return how many cells they
/// have done.
KNAV_AVX2 int add_to_cells_avx2(const TsdfRules& rules, const TsdfObservation& observation, const std::int32_t* column,
                                const float* distance_m, int count, const TsdfCells& cells, TsdfChange* change,
                                std::uint64_t* contradicted);
KNAV_AVX2 int remove_from_cells_avx2(const TsdfRules& rules, const TsdfObservation& observation,
                                     const std::int32_t* column, const float* distance_m, int count,
                                     const TsdfCells& cells, TsdfChange* change);

}  // namespace knav

#endif
