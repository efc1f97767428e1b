#pragma once

#include <string>

namespace knav {

/// How another stack is driven by the benchmark.
struct ExternalOptions {
  double rate = 1.0;        ///< simulated seconds in a wall second; 0 = as fast as the stack follows
  double lead_s = 0.2;      ///< of simulated time before the stack's newest answer, where time waits for it
  std::string wait_topic;   ///< whose stamps are the stack's answer to its sensors; empty: those of TF map -> odom
  bool lidar = false;       ///< publishes the LIDAR as `scan`
  double ready_within_s = 30.0;  ///< wall time in which the stack must show what it is asked for
};

}  // namespace knav
