#pragma once

#include <string>

#include "brin_benchmark/navigation_stack.h"
#include "core/pose2.h"

namespace knav {

/// Keeps what the robot saw and thought lately, so that a failure can be looked into.
class FlightRecorder {
 public:
  virtual ~FlightRecorder() = default;
  /// Every depth frame, after the stack took it.
  virtual void frame(double stamp_s, const Pose2& T_world_base, const Pose2& T_odom_base,
                     const NavigationStack& stack) = 0;
  /// A leg failed: what was kept is to be written.
  virtual void failure(const std::string& leg, const std::string& reason) = 0;
};

}  // namespace knav
