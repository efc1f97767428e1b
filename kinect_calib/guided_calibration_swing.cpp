// How GuidedCalibration learns from the range finder what square looks like.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "kinect_calib/guided_calibration.h"

namespace knav {
namespace {

constexpr double kRadPerDeg = kPi / 180.0;
constexpr double kThere_rad = 2.0 * kRadPerDeg;  // both sides are measured: how far exactly does not matter
constexpr double kAstray_rad = 8.0 * kRadPerDeg;
constexpr int kLeastFrames = 5;
// Two ranges are compared that differ by little: more readings than for a distance.
constexpr int kReadingsFactor = 2;

}  // namespace

void GuidedCalibration::start_swing() {
  enter(GuidedState::kSwing);
  swing_ = Swing{};
  swing_.distance_m = last_finished_m_;
  swing_to(SwingPhase::kLeft);
}

void GuidedCalibration::swing_to(SwingPhase phase) {
  swing_phase_ = phase;
  swing_standing_ = false;
  swing_since_s_ = now_s_;
}

/// By odometry: to the sides the wall may end in view, which is no reason to get lost.
void GuidedCalibration::swing(const GuidedInput& input, GuidedStep* step) {
  const bool left = swing_phase_ == SwingPhase::kLeft, back = swing_phase_ == SwingPhase::kBack;
  if (!back && !input.wall.fault.empty()) return swing_to(SwingPhase::kBack);
  text_ = "turning to both sides, to see by the range finder what is square";
  if (!swing_standing_) {
    const double side_rad = back ? 0.0 : (left ? 1.0 : -1.0) * config_.swing_deg * kRadPerDeg;
    const double turned_rad = normalize_angle_rad(input.T_odom_base.yaw_rad - T_odom_stood_.yaw_rad);
    const double to_go_rad = normalize_angle_rad(side_rad - turned_rad);
    if (std::abs(turned_rad) > config_.swing_deg * kRadPerDeg + kAstray_rad ||
        input.now_s - swing_since_s_ > config_.square_limit_s) {
      return fail(fmt::format(
          "the robot was to turn by {} degrees to both sides and is at {:.0f} by odometry: does it "
          "obey cmd_vel, and does odometry's yaw rise to the left?",
          config_.swing_deg, turned_rad / kRadPerDeg));
    }
    if (std::abs(to_go_rad) > kThere_rad) {
      const double speed =
          std::clamp(2.0 * std::abs(to_go_rad), config_.turn_min_radps, config_.turn_max_radps);
      step->turn_radps = to_go_rad > 0.0 ? speed : -speed;
      return;
    }
    if (back) return start_moving();  // which holds it square as it goes
    swing_standing_ = true;
    swing_since_s_ = input.now_s;
    ranges_.clear();
    sum_yaw_rad_ = 0.0, stood_frames_ = 0;
    return;
  }
  if (input.now_s - swing_since_s_ < 0.5 * config_.settle_s) return;
  for (const double range_m : input.ranges_m) ranges_.add(range_m + start_.range_offset_m);
  if (input.new_frame && input.depth_stamp_s > swing_since_s_ + 0.25 * config_.settle_s) {
    sum_yaw_rad_ += input.wall.plane.yaw_rad();
    ++stood_frames_;
  }
  if (ranges_.count() < kReadingsFactor * config_.range_readings || stood_frames_ < kLeastFrames) return;
  if (!ranges_.fault().empty()) return swing_to(SwingPhase::kBack);
  (left ? swing_.left_yaw_rad : swing_.right_yaw_rad) = sum_yaw_rad_ / stood_frames_;
  (left ? swing_.left_range_m : swing_.right_range_m) = ranges_.median_m();
  if (left) return swing_to(SwingPhase::kRight);
  square_bias_.add(swing_);
  notice_ = fmt::format(
      "turned to {:.2f} deg: {:.4f} m, to {:.2f} deg: {:.4f} m; a square wall seems turned by {:.2f} deg.",
      swing_.left_yaw_rad / kRadPerDeg, swing_.left_range_m, swing_.right_yaw_rad / kRadPerDeg,
      swing_.right_range_m, square_bias_.apparent_yaw_rad(swing_.distance_m) / kRadPerDeg);
  swing_to(SwingPhase::kBack);
}

}  // namespace knav
