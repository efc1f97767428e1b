#pragma once

#include <vector>

namespace knav {

/// A planar scan with the values of REP 117: a return in [range_min, range_max], +Inf = seen free to range_max,
/// NaN = unknown. Unknown is never free.
struct RangeScan {
  double stamp_s = 0.0;
  double angle_min_rad = 0.0;        ///< of the first ray, counter-clockwise from the sensor's x axis
  double angle_increment_rad = 0.0;
  double range_min_m = 0.0;
  double range_max_m = 0.0;
  std::vector<float> range_m;
  std::vector<float> evidence;  ///< per ray, 1 = fresh, falling with age; empty = all 1
};

}  // namespace knav
