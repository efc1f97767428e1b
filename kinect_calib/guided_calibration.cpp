#include "kinect_calib/guided_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace knav {
namespace {

constexpr int kMostRefusals = 3;
constexpr double kClockJump_s = 0.5;

}  // namespace

const char* name_of(GuidedState state) {
  switch (state) {
    case GuidedState::kWait:
      return "waiting";
    case GuidedState::kSquareUp:
      return "turning square";
    case GuidedState::kSettle:
      return "settling";
    case GuidedState::kMove:
      return "moving";
    case GuidedState::kCollect:
      return "collecting";
    case GuidedState::kAsk:
      return "asking";
    case GuidedState::kSwing:
      return "swinging";
    case GuidedState::kPaused:
      return "paused";
    case GuidedState::kDone:
      return "done";
    case GuidedState::kFailed:
      return "stopped";
  }
  return "";
}

GuidedCalibration::GuidedCalibration(const GuidedCalibrationConfig& config, GuidedStart start)
    : config_(config), start_(std::move(start)) {
  finished_ = static_cast<int>(start_.done_m.size());
  for (const double distance_m : start_.done_m) last_finished_m_ = std::max(last_finished_m_, distance_m);
  target_m_ = finished_ > 0 ? config_.next_distance_m(last_finished_m_) : config_.first_distance_m;
  if (!start_.behind_is_free) {
    fail("nobody has said that the way behind is free, and the robot backs off blind: look, then say so.");
  } else if (target_m_ <= 0.0) {
    enter(GuidedState::kDone);
  }
}

int GuidedCalibration::total_count() const {
  if (finished_ == 0) return 1 + config_.steps_after(config_.first_distance_m);
  return finished_ + config_.steps_after(last_finished_m_);
}

void GuidedCalibration::enter(GuidedState state) {
  if (state_ == GuidedState::kCollect && state != GuidedState::kCollect && state != GuidedState::kAsk)
    drop_ = true;
  if (state == GuidedState::kSquareUp && state_ != GuidedState::kSettle) {
    square_since_s_ = now_s_;
    square_from_rad_ = -1.0;
  }
  if (state == GuidedState::kSettle || state == GuidedState::kSquareUp) turn_radps_ = 0.0;
  if (state == GuidedState::kSettle) sum_yaw_rad_ = sum_depth_m_ = 0.0, stood_frames_ = 0;
  if (state == GuidedState::kCollect) {
    ranges_.clear();
    frames_ = 0;
    sum_yaw_rad_ = sum_depth_m_ = 0.0, stood_frames_ = 0;
  }
  state_ = state;
  entered_s_ = now_s_;
  text_.clear();
}

void GuidedCalibration::fail(const std::string& why) {
  enter(GuidedState::kFailed);
  text_ = why;
}

std::string GuidedCalibration::trouble(const GuidedInput& input) const {
  const double depth_age_s = input.now_s - input.depth_stamp_s;
  const double odometry_age_s = input.now_s - input.odometry_stamp_s;
  if (!std::isfinite(depth_age_s))
    return fmt::format("no depth image has come on '{}' yet.", start_.depth_topic);
  if (depth_age_s > config_.depth_stale_s)
    return fmt::format("the newest depth image on '{}' is {:.1f} s old.", start_.depth_topic, depth_age_s);
  if (!std::isfinite(odometry_age_s))
    return fmt::format("no odometry has come on '{}' yet.", start_.odometry_topic);
  if (odometry_age_s > config_.odometry_stale_s)
    return fmt::format("the newest odometry on '{}' is {:.1f} s old.", start_.odometry_topic, odometry_age_s);
  if (!input.wall.fault.empty() && state_ != GuidedState::kSwing) return input.wall.fault;
  const double range_age_s = input.now_s - newest_range_s_;
  if (start_.range_finder && !std::isfinite(range_age_s)) {
    return fmt::format("no reading of the range finder has come on '{}' yet; without one, start with --ask.",
                       start_.range_topic);
  }
  if (start_.range_finder && range_age_s > config_.range_stale_s)
    return fmt::format("the range finder on '{}' has been silent for {:.1f} s.", start_.range_topic,
                       range_age_s);
  return "";
}

/// Stands while something is wrong and goes on once all has been well for a while: somebody who walks through
/// costs seconds, not the calibration.
bool GuidedCalibration::stopped_by_trouble(const GuidedInput& input) {
  const std::string what = trouble(input);
  if (state_ != GuidedState::kPaused && state_ != GuidedState::kWait) {
    if (what.empty()) return false;
    enter(GuidedState::kPaused);
    trouble_since_s_ = input.now_s;
  }
  if (trouble_since_s_ < 0.0) trouble_since_s_ = input.now_s;
  if (!what.empty()) {
    calm_since_s_ = -1.0;
    text_ = what;
    if (input.now_s - trouble_since_s_ > config_.give_up_s) fail(what);
  } else {
    if (calm_since_s_ < 0.0) calm_since_s_ = input.now_s;
    if (input.now_s - calm_since_s_ >= (started_ ? config_.calm_s : 0.0)) {
      started_ = true;
      trouble_since_s_ = calm_since_s_ = -1.0;
      anchored_ = false;  // who knows what happened meanwhile: the place is taken from depth again
      moves_ = 0;
      enter(GuidedState::kSquareUp);
      return false;
    }
  }
  return true;
}

GuidedStep GuidedCalibration::step(const GuidedInput& input) {
  GuidedStep step;
  const auto ended = [&] { return state_ == GuidedState::kDone || state_ == GuidedState::kFailed; };
  if (input.now_s < now_s_ - kClockJump_s && !ended())
    fail(fmt::format("the clock jumped back by {:.1f} s.", now_s_ - input.now_s));
  now_s_ = input.now_s;
  if (!input.ranges_m.empty()) newest_range_s_ = input.now_s;
  // While it asks it stands, however long that takes.
  if (!ended() && (state_ == GuidedState::kAsk || !stopped_by_trouble(input))) {
    switch (state_) {
      case GuidedState::kSquareUp:
        square_up(input, &step);
        break;
      case GuidedState::kSettle:
        settle(input);
        break;
      case GuidedState::kMove:
        move(input, &step);
        break;
      case GuidedState::kCollect:
        collect(input, &step);
        break;
      case GuidedState::kAsk:
        ask(input, &step);
        break;
      case GuidedState::kSwing:
        swing(input, &step);
        break;
      default:
        break;
    }
  }
  if (state_ == GuidedState::kFailed || state_ == GuidedState::kPaused)
    step.forward_mps = step.turn_radps = 0.0;
  step.state = state_;
  step.text = text_.empty() ? name_of(state_) : text_;
  step.notice = std::exchange(notice_, "");
  step.drop_frames = std::exchange(drop_, false);
  if (step.drop_frames) step.keep_frame = false;
  return step;
}

void GuidedCalibration::accept() {
  ++finished_;
  refused_ = 0;
  last_finished_m_ = anchor_m_ = finishing_m_;
  anchor_depth_m_ = stood_depth_m_;
  T_odom_anchor_ = T_odom_stood_;
  target_m_ = config_.next_distance_m(last_finished_m_);
  if (target_m_ <= 0.0) return enter(GuidedState::kDone);
  if (start_.range_finder && config_.swing_every > 0 && finished_ % config_.swing_every == 0)
    return start_swing();
  start_moving();
}

void GuidedCalibration::refuse(const std::string& why) {
  if (++refused_ >= kMostRefusals) {
    fail(fmt::format("{} (measured {} times)", why, refused_));
  } else {
    enter(GuidedState::kSquareUp);
    drop_ = true;
    notice_ = why + " It is measured again.";
  }
}

}  // namespace knav
