#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace knav {

/// Maps a device's clock (microseconds from an arbitrary zero) to host time. A frame's arrival is late by a
/// jittering time; the median of the last differences host - device is not moved by single late frames (as
/// openni2_camera does).
class DeviceClock {
 public:
  /// @param window how many differences the median is taken over
  /// @param jump_s a difference that lies farther than this from the median is another zero, not a late
  /// frame: the
  ///   device restarted, a recording began again, or the host's clock was set. The history is dropped then.
  explicit DeviceClock(std::size_t window = 15, double jump_s = 0.5);

  /// Host time [s] of a frame with the device's time, which arrived at `arrival_s`. Never later than the
  /// arrival, and always after the previous frame's unless the mapping jumped.
  double to_host_s(uint64_t device_time_us, double arrival_s);
  void reset();

  /// Median of host - device [s]; 0 before the first frame.
  double offset_s() const { return offset_s_; }
  /// How often the history was dropped for a jump.
  int jumps() const { return jumps_; }

 private:
  std::size_t window_;
  double jump_s_;
  std::vector<double> differences_s_, sorted_;
  std::size_t next_ = 0;
  double offset_s_ = 0.0;
  double last_s_ = 0.0;
  bool any_ = false;
  int jumps_ = 0;
};

}  // namespace knav
