#pragma once

namespace knav {

/// Notices a clock that jumped back: a bag that loops, a simulator that was reset.
class ClockWatch {
 public:
  /// @param tolerance_s how far back a stamp may lie behind the newest without being a jump (frames out of order)
  explicit ClockWatch(double tolerance_s = 1.0) : tolerance_s_(tolerance_s) {}

  /// True if this stamp lies more than the tolerance behind the newest one; that stamp is then the newest.
  bool jumped_back(double stamp_s) {
    const bool jumped = any_ && stamp_s < newest_s_ - tolerance_s_;
    if (!any_ || jumped || stamp_s > newest_s_) newest_s_ = stamp_s;
    any_ = true;
    return jumped;
  }

 private:
  double tolerance_s_;
  double newest_s_ = 0.0;
  bool any_ = false;
};

}  // namespace knav
