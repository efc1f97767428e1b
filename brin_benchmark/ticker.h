#pragma once

#include <algorithm>

namespace knav {

/// True once per period of simulated time.
class Ticker {
 public:
  explicit Ticker(double period_s) : period_s_(period_s) {}
  bool due(double now_s) {
    if (now_s < next_s_ - 1e-9) return false;
    next_s_ = std::max(next_s_ + period_s_, now_s);
    return true;
  }

 private:
  double period_s_;
  double next_s_ = 0.0;
};

}  // namespace knav
