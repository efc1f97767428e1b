#pragma once

#include "tools/mapper_accuracy.h"

namespace knav {

/// What becomes of the estimate while a robot stands, and after that: its longest stop.
struct ParkedAccuracy {
  double parked_s = 0.0;                   ///< 0: it did not stop
  double moved_m = 0.0, turned_deg = 0.0;  ///< the estimate at most, from where it was when the robot had stood for a second
  double later_m = 0.0;                    ///< error of the way from the stop to kLater_m farther on
  double seen_before = 0.0, seen_after = 0.0;  ///< ScanShare of the stop's first and last minute, mean; NaN without scans

  static constexpr double kLater_m = 10.0;
};

/// @param shares  of the drive's virtual scans, may be empty
ParkedAccuracy parked_accuracy(const Trajectory& estimate, const Trajectory& truth, const std::vector<ScanShare>& shares);

}  // namespace knav
