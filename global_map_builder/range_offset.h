#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "core/depth_profile.h"

namespace knav {

/// What a calibration leaves of a depth camera's error: an offset of its disparity that varies slowly across the
/// image, z_true = 1 / (1 / z + offset(column)). Piecewise linear between knots at even distances.
class RangeOffset {
 public:
  static constexpr int kKnots = 9;
  std::array<double, kKnots> knot_per_m{};

  /// The two knots beside a column and the second one's share.
  struct Place {
    int first;
    double share;
  };
  static Place place(double column_share) {
    const double at = std::clamp(column_share, 0.0, 1.0) * (kKnots - 1);
    const int first = std::min(kKnots - 2, static_cast<int>(at));
    return {first, at - first};
  }
  double at(double column_share) const {
    const Place p = place(column_share);
    const auto i = static_cast<std::size_t>(p.first);
    return (1.0 - p.share) * knot_per_m[i] + p.share * knot_per_m[i + 1];
  }
  double corrected_m(double z_m, double column_share) const { return 1.0 / (1.0 / z_m + at(column_share)); }

  bool any() const {
    return std::any_of(knot_per_m.begin(), knot_per_m.end(), [](double v) { return v != 0.0; });
  }
  void apply(DepthProfile* profile) const {
    const auto columns = static_cast<double>(profile->z_m.size());
    for (std::size_t u = 0; u < profile->z_m.size(); ++u) {
      const double offset = at((static_cast<double>(u) + 0.5) / columns);
      for (std::vector<float>* distance : {&profile->z_m, &profile->free_to_m}) {
        float& z = (*distance)[u];
        if (z > 0.0f) z = static_cast<float>(1.0 / (1.0 / static_cast<double>(z) + offset));  // NaN stays
      }
    }
  }
};

}  // namespace knav
