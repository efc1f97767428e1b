// What GuidedCalibration does in each of its states.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "kinect_calib/guided_calibration.h"

namespace knav {
namespace {

constexpr double kRadPerDeg = kPi / 180.0;
constexpr int kMostMoves = 5;
constexpr int kLeastStoodFrames = 3;
constexpr double kStoodStill_m = 0.004, kStoodStill_rad = 0.3 * kRadPerDeg;
constexpr double kWrongWay_rad = 5.0 * kRadPerDeg;  // further off than at the start: it turns the wrong way
// Odometry against depth. A device that reads 10 % long at 10 m takes 0.4 m for 0.43 m at 4 m.
constexpr double kSlipShare = 0.3, kSlip_m = 0.04;
constexpr double kNoWay_s = 3.0;      // commanded for so long, it must have moved
constexpr double kArrived_m = 0.005;  // it comes to rest a little further on
constexpr double kSlowest_mps = 0.02;

double along_m(const Pose2& T_from_to) { return T_from_to.x_m; }

}  // namespace

double GuidedCalibration::turn_towards_square(double yaw_rad) const {
  constexpr double kGain_per_s = 0.8;
  const double speed =
      std::clamp(kGain_per_s * std::abs(yaw_rad), config_.turn_min_radps, config_.turn_max_radps);
  return yaw_rad > 0.0 ? -speed : speed;
}

void GuidedCalibration::square_up(const GuidedInput& input, GuidedStep* step) {
  if (input.new_frame) {
    const double yaw_rad = off_square_rad(input);
    if (square_from_rad_ < 0.0) square_from_rad_ = std::abs(yaw_rad);
    // Turning it stops early: frames come late, and the base takes time to stop.
    const bool there = std::abs(yaw_rad) < 0.5 * config_.square_within_deg * kRadPerDeg;
    const bool passed = turn_radps_ != 0.0 && (turn_radps_ < 0.0) != (yaw_rad > 0.0);
    if (std::abs(yaw_rad) > square_from_rad_ + kWrongWay_rad) {
      return fail(
          fmt::format("turning towards the wall's normal took the robot {:.0f} degrees further away: does it "
                      "turn left for a positive angular.z?",
                      (std::abs(yaw_rad) - square_from_rad_) / kRadPerDeg));
    }
    if (there || passed) return enter(GuidedState::kSettle);
    turn_radps_ = turn_towards_square(yaw_rad);
    text_ = fmt::format("turning square, {:.1f} deg to go", std::abs(yaw_rad) / kRadPerDeg);
  }
  if (input.now_s - square_since_s_ > config_.square_limit_s) {
    return fail(fmt::format(
        "the robot cannot get square: after {:.0f} s it is {:.1f} degrees off, and {} are allowed; "
        "does it obey cmd_vel, down to {} rad/s (turn_min_radps)?",
        config_.square_limit_s, std::abs(off_square_rad(input)) / kRadPerDeg, config_.square_within_deg,
        config_.turn_min_radps));
  }
  step->turn_radps = turn_radps_;
}

void GuidedCalibration::settle(const GuidedInput& input) {
  const double stood_s = input.now_s - entered_s_;
  if (stood_s < 0.5 * config_.settle_s) return;
  if (input.new_frame && input.depth_stamp_s > entered_s_) {
    sum_yaw_rad_ += off_square_rad(input);
    sum_depth_m_ += input.wall.plane.distance_m();
    ++stood_frames_;
  }
  if (stood_s < config_.settle_s || stood_frames_ < kLeastStoodFrames) return;
  off_square_deg_ = sum_yaw_rad_ / stood_frames_ / kRadPerDeg;
  stood_depth_m_ = sum_depth_m_ / stood_frames_;
  T_odom_stood_ = input.T_odom_base;
  if (std::abs(off_square_deg_) > config_.square_within_deg) return enter(GuidedState::kSquareUp);
  if (!anchored_) {
    anchored_ = true;
    anchor_m_ = anchor_depth_m_ = stood_depth_m_;
    T_odom_anchor_ = input.T_odom_base;
  }
  const double close_m = std::max(0.01, 0.15 * config_.step * target_m_);
  if (std::abs(target_m_ - here_m(input)) <= close_m) {
    moves_ = 0;
    return enter(GuidedState::kCollect);
  }
  if (++moves_ > kMostMoves) {
    return fail(fmt::format(
        "the robot does not come to stand at {:.2f} m from the wall: it is at {:.2f} m after {} moves.",
        target_m_, here_m(input), kMostMoves));
  }
  start_moving();
}

double GuidedCalibration::off_square_rad(const GuidedInput& input) const {
  const WallPlane& plane = input.wall.plane;
  return plane.yaw_rad() - square_bias_.apparent_yaw_rad(plane.distance_m());
}

/// By odometry from where the distance was known.
double GuidedCalibration::here_m(const GuidedInput& input) const {
  return anchor_m_ - along_m(T_odom_anchor_.inverse() * input.T_odom_base);
}

bool GuidedCalibration::has_moved(const GuidedInput& input, double patience) const {
  const Pose2 moved = T_odom_stood_.inverse() * input.T_odom_base;
  return std::hypot(moved.x_m, moved.y_m) > patience * kStoodStill_m ||
         std::abs(moved.yaw_rad) > patience * kStoodStill_rad;
}

void GuidedCalibration::start_moving() {
  enter(GuidedState::kMove);
  checked_s_ = now_s_;
  T_odom_checked_ = T_odom_stood_;
  direction_ = 0;
}

void GuidedCalibration::move(const GuidedInput& input, GuidedStep* step) {
  const double left_m = target_m_ - here_m(input);  // positive: back
  const double gone_m = here_m(input) - anchor_m_;
  const double seen_m = input.wall.plane.distance_m() - anchor_depth_m_;
  if (std::abs(gone_m - seen_m) > kSlip_m + kSlipShare * std::abs(gone_m)) {
    return fail(
        fmt::format("odometry says that the robot has backed off {:.2f} m, and depth says {:.2f} m: do the "
                    "wheels slip, or is something in the way behind?",
                    gone_m, seen_m));
  }
  if (input.now_s - checked_s_ > kNoWay_s) {
    if (std::abs(along_m(T_odom_checked_.inverse() * input.T_odom_base)) < 0.2 * kSlowest_mps * kNoWay_s) {
      return fail(fmt::format(
          "the robot was told to drive for {:.0f} s and has not moved: does it obey cmd_vel, and is "
          "the way behind free?",
          kNoWay_s));
    }
    checked_s_ = input.now_s;
    T_odom_checked_ = input.T_odom_base;
  }
  const bool forward = left_m < 0.0;
  // A target just passed is not turned back to: settle() judges where it stands.
  if (std::abs(left_m) < kArrived_m || direction_ == (forward ? -1 : 1)) return enter(GuidedState::kSquareUp);
  direction_ = forward ? 1 : -1;
  const double yaw_rad = off_square_rad(input);
  if (std::abs(yaw_rad) > kWrongWay_rad) return enter(GuidedState::kSquareUp);
  const double speed = std::min(config_.speed_mps, std::max(kSlowest_mps, 1.5 * std::abs(left_m)));
  step->forward_mps = forward ? speed : -speed;
  // A gentle hand on the wheel; what it leaves is turned away standing.
  step->turn_radps = std::clamp(-0.5 * yaw_rad, -config_.turn_min_radps, config_.turn_min_radps);
  text_ = fmt::format("{}, {:.2f} m to go to {:.2f} m", forward ? "driving up" : "backing off",
                      std::abs(left_m), target_m_);
}

void GuidedCalibration::collect(const GuidedInput& input, GuidedStep* step) {
  if (has_moved(input, 1.0)) return refuse("the robot moved while it should stand.");
  for (const double range_m : input.ranges_m) ranges_.add(range_m + start_.range_offset_m);
  if (input.new_frame && frames_ < config_.frames && input.depth_stamp_s > entered_s_) {
    step->keep_frame = true;
    ++frames_;
    sum_yaw_rad_ += off_square_rad(input);
    sum_depth_m_ += input.wall.plane.distance_m();
    ++stood_frames_;
  }
  text_ = fmt::format("collecting: {} of {} frames", frames_, config_.frames);
  if (start_.range_finder) text_ += fmt::format(", {} of {} ranges", ranges_.count(), config_.range_readings);
  if (frames_ < config_.frames || (start_.range_finder && ranges_.count() < config_.range_readings)) return;
  off_square_deg_ = sum_yaw_rad_ / stood_frames_ / kRadPerDeg;
  stood_depth_m_ = sum_depth_m_ / stood_frames_;
  if (!start_.range_finder) {
    enter(GuidedState::kAsk);
    text_ = fmt::format(
        "type the distance from the camera to the wall in metres; depth says {:.3f}, but that is what "
        "is to be calibrated, so measure",
        stood_depth_m_);
    return;
  }
  const std::string fault = ranges_.fault();
  if (!fault.empty()) return refuse(fmt::format("the range finder on '{}' {}", start_.range_topic, fault));
  finish(ranges_.median_m(), ranges_.count(), step);
}

void GuidedCalibration::ask(const GuidedInput& input, GuidedStep* step) {
  // A gyro's yaw drifts while somebody looks for the tape.
  if (has_moved(input, 5.0)) {
    drop_ = true;
    notice_ = "the robot has moved meanwhile; its images are taken again.";
    return enter(GuidedState::kSquareUp);
  }
  if (!input.typed_m) return;
  finish(*input.typed_m, 0, step);
}

void GuidedCalibration::finish(double distance_m, int readings, GuidedStep* step) {
  // A device's own error is a few per cent here; more is a slip of the hand, another unit, or a beam astray.
  if (!(std::abs(distance_m - stood_depth_m_) <= 0.03 + 0.12 * stood_depth_m_)) {
    if (readings > 0) {
      return refuse(
          fmt::format("the range finder on '{}' says {:.3f} m and depth {:.3f} m: aim its beam at the "
                      "cross in calibration_view, and check --range-offset.",
                      start_.range_topic, distance_m, stood_depth_m_));
    }
    notice_ =
        fmt::format("{} m cannot be: depth says about {:.2f} m; type the distance in metres:", distance_m,
                    stood_depth_m_);
    return;
  }
  if (finished_ > 0 && distance_m < last_finished_m_ * 1.01 && distance_m > last_finished_m_ * 0.99)
    return refuse(fmt::format("{:.3f} m is the distance before: the robot has not moved on.", distance_m));
  step->finished = GuidedDistance{distance_m, readings > 0 ? ranges_.sd_m() : 0.0, readings, stood_depth_m_,
                                  off_square_deg_};
  finishing_m_ = distance_m;
}

}  // namespace knav
