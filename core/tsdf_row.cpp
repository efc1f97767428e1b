#include "core/tsdf_row.h"

#include "core/tsdf_cell.h"
#include "core/tsdf_row_avx2.h"

namespace knav {

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
