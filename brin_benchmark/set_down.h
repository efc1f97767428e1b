#pragma once

#include <cmath>
#include <functional>

#include "core/pose2.h"

namespace knav {

/// Tries the pose itself, then rings round it 0.25 m apart, up to 2 m.
/// @param set_down  T_wanted_robot: sets the robot down there; false if there is no room
inline bool set_down_near(const std::function<bool(const Pose2& aside)>& set_down) {
  for (int ring = 0; ring <= 8; ++ring) {
    for (int k = 0; k < (ring == 0 ? 1 : 12); ++k) {
      const double angle = k * kPi / 6.0;
      if (set_down({0.25 * ring * std::cos(angle), 0.25 * ring * std::sin(angle), 0.0})) return true;
    }
  }
  return false;
}

}  // namespace knav
