#pragma once

#include "core/pose2.h"

namespace knav {

/// Notices that a goal gets no nearer.
class GoalWatch {
 public:
  void start(double now_s) {
    progress_s_ = now_s;
    best_m_ = 1e9;
    anchor_s_ = now_s;
  }
  /// @param remaining_m of the path; a new path only counts once it was followed a bit, and one as long as the old is the old:
  /// a robot that steps aside and comes back gets no nearer
  void progress(double now_s, double remaining_m, bool new_path) {
    if (new_path && (remaining_m < best_m_ || remaining_m > best_m_ + kOtherWay_m)) best_m_ = remaining_m;
    if (remaining_m > best_m_ - kStep_m) return;
    if (best_m_ < 1e8) progress_s_ = now_s;
    best_m_ = remaining_m;
  }
  /// Driving, but staying within `distance_m` of one place: for how long [s]?
  double dithering_s(double now_s, const Pose2& T_odom_base, bool driving, double within_m) {
    if (!driving || distance_m(anchor_, T_odom_base) > within_m) {
      anchor_ = T_odom_base;
      anchor_s_ = now_s;
    }
    return now_s - anchor_s_;
  }
  void made_progress(double now_s) { progress_s_ = now_s; }
  double without_progress_s(double now_s) const { return now_s - progress_s_; }

 private:
  static constexpr double kStep_m = 0.3;
  static constexpr double kOtherWay_m = 1.0;

  double progress_s_ = 0.0, best_m_ = 1e9, anchor_s_ = 0.0;
  Pose2 anchor_;
};

}  // namespace knav
