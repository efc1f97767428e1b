#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace knav {

/// The value that a share q in [0, 1] of `values` does not exceed (nearest rank); NaN if there are none.
inline double quantile(std::vector<double> values, double q) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto rank = static_cast<std::ptrdiff_t>(std::lround(q * static_cast<double>(values.size() - 1)));
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[static_cast<std::size_t>(rank)];
}

}  // namespace knav
