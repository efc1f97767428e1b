#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <mutex>

namespace knav {

struct PacingConfig {
  double rate = 1.0;          ///< simulated seconds in a wall second; 0 = as fast as the stack follows
  bool wait_for_stack = false;  ///< time stops for the stack at any rate
  double lead_s = 0.2;        ///< simulated time is at most this far ahead of what the stack answered last
  double patience_s = 1.0;    ///< wall time an answer is waited for; then it counts as silent until it comes again

  bool waits() const { return wait_for_stack || rate <= 0.0; }
};

/// Lets simulated time go on: as the wall clock does, or as the robot's stack follows. "Follows" is what any stack
/// shows: the stamps of its pose, and its velocity commands while it has a goal. While one of them is silent, time goes
/// on as on the wall, for a stack may be slow for reasons that need time to pass.
class ClockPacer {
 public:
  enum Answer { kPose, kCommand };

  explicit ClockPacer(const PacingConfig& config);

  const PacingConfig& config() const { return config_; }

  /// The stack has answered to what was at this simulated time; from any thread.
  void heard(Answer answer, double stamp_s);
  /// Blocks until simulated time may go on from now_s.
  /// @param expects_command  the stack has a goal
  void wait(double now_s, bool expects_command);

 private:
  using Wall = std::chrono::steady_clock;
  void follow_wall(double now_s, double rate);
  /// False if the answer is silent.
  bool follow(Answer answer, double now_s);

  PacingConfig config_;
  std::mutex mutex_;  ///< newest_s_ and silent_
  std::condition_variable heard_;
  std::array<double, 2> newest_s_{};
  std::array<bool, 2> silent_{};
  bool started_ = false, expected_command_ = false;
  Wall::time_point due_;
  double last_s_ = 0.0;
};

}  // namespace knav
