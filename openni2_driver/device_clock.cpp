#include "openni2_driver/device_clock.h"

#include <algorithm>
#include <cmath>

namespace knav {

DeviceClock::DeviceClock(std::size_t window, double jump_s)
    : window_(std::max<std::size_t>(window, 1)), jump_s_(jump_s) {
  differences_s_.reserve(window_);
  sorted_.reserve(window_);
}

void DeviceClock::reset() {
  differences_s_.clear();
  next_ = 0;
  offset_s_ = 0.0;
  any_ = false;
}

double DeviceClock::to_host_s(uint64_t device_time_us, double arrival_s) {
  const double device_s = static_cast<double>(device_time_us) * 1e-6;
  const double difference_s = arrival_s - device_s;
  if (!differences_s_.empty() && std::abs(difference_s - offset_s_) > jump_s_) {
    reset();
    ++jumps_;
  }
  if (differences_s_.size() < window_) {
    differences_s_.push_back(difference_s);
  } else {
    differences_s_[next_] = difference_s;
  }
  next_ = (next_ + 1) % window_;

  sorted_ = differences_s_;
  const auto middle = sorted_.begin() + static_cast<std::ptrdiff_t>(sorted_.size() / 2);
  std::nth_element(sorted_.begin(), middle, sorted_.end());
  offset_s_ = *middle;

  // A frame was not taken after it arrived, and no two frames have one stamp (1 us is what ROS stamps keep
  // apart).
  double host_s = std::min(device_s + offset_s_, arrival_s);
  if (any_ && host_s <= last_s_) host_s = last_s_ + 1e-6;
  last_s_ = host_s;
  any_ = true;
  return host_s;
}

}  // namespace knav
