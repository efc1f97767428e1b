#include "kinect_calib/standing_range.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/quantile.h"

namespace knav {

double StandingRange::median_m() const { return quantile(readings_m_, 0.5); }

double StandingRange::sd_m() const {
  if (readings_m_.size() < 2) return 0.0;
  double mean = 0.0, squares = 0.0;
  for (const double r : readings_m_) mean += r / static_cast<double>(readings_m_.size());
  for (const double r : readings_m_) squares += (r - mean) * (r - mean);
  return std::sqrt(squares / static_cast<double>(readings_m_.size() - 1));
}

std::string StandingRange::fault() const {
  if (readings_m_.empty()) return "says nothing";
  for (const double r : readings_m_) {
    if (!std::isfinite(r) || r <= 0.0) return "gives no distance; is its beam on the wall?";
  }
  const auto [low, high] = std::minmax_element(readings_m_.begin(), readings_m_.end());
  if (*high - *low <= kSteadyRangeWithin_m) return "";
  return fmt::format("jumps from {:.3f} to {:.3f} m while the robot stands; is its beam on the wall's edge?",
                     *low, *high);
}

}  // namespace knav
