#pragma once

#include <cstdint>

namespace knav {

/// Microseconds from the Kinect's 32 bit counter of a 60 MHz clock, which is back at 0 every 71.6 s.
class TickClock {
 public:
  uint64_t to_us(uint32_t ticks) {
    if (!any_) last_ = ticks;
    any_ = true;
    // The difference of two counters is right across the wrap; one that would be half a turn is a frame out
    // of order.
    const uint32_t step = ticks - last_;
    if (step < 0x80000000U) {
      total_ += step;
      last_ = ticks;
    }
    return total_ / 60;
  }

 private:
  bool any_ = false;
  uint32_t last_ = 0;
  uint64_t total_ = 0;
};

}  // namespace knav
