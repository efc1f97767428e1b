#pragma once

#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "core/depth_profile.h"
#include "core/tsdf_grid.h"

namespace knav {

inline constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

inline TsdfConfig fixed_truncation(double mu_m) {
  TsdfConfig config;
  config.resolution_m = 0.05;  // the tests count in cells of 5 cm
  config.truncation = {mu_m, 0.0, mu_m, 0.0, 0, 0.0, 1.0, 1.0, mu_m};  // the paper's
  return config;
}

inline ObservationLimits limits_of(const TsdfConfig& config) {
  ObservationLimits limits;
  limits.truncation = config.truncation;
  limits.clear_margin_m = config.clear_margin_m;
  return limits;
}

/// A camera of `columns` columns whose middle one looks straight ahead.
inline DepthProfile profile_of(std::vector<float> z_m, double fx_px) {
  DepthProfile profile;
  const std::size_t n = z_m.size();
  profile.fx_px = fx_px;
  profile.cx_px = static_cast<double>(n - 1) / 2.0;
  profile.z_m = std::move(z_m);
  profile.free_from_m.assign(n, kNaN);
  profile.free_to_m.assign(n, kNaN);
  profile.height_class.assign(n, HeightClass::kMiddle);
  return profile;
}

}  // namespace knav
