#include "kinect_calib/live_calibration.h"

#include <fmt/format.h>
#include <ros/callback_queue.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "kinect_calib/depth_calibrator.h"
#include "ros_common/program.h"

namespace knav {
namespace {

constexpr double kStep_s = 0.03;
constexpr double kClockStands_s = 10.0;

void wait_for_clock() {
  while (ros::ok() && !ros::Time::isValid()) {
    stop_if_interrupted();
    ros::WallDuration(0.05).sleep();
  }
}

void spin_for(double seconds) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(seconds);
  for (ros::WallDuration left(seconds); left > ros::WallDuration(0.0); left = end - ros::WallTime::now()) {
    ros::getGlobalCallbackQueue()->callAvailable(left);
  }
}

std::string measured_line(const GuidedInput& input) {
  const SeenWall& wall = input.wall;
  if (!wall.fault.empty() || wall.plane.per_m <= 0.0) return wall.fault;
  const double degree = kPi / 180.0;
  return fmt::format(
      "depth {:.3f} m, {:.2f} deg off square, looking {:.1f} deg {}, {:.1f} codes rms off the plane",
      wall.plane.distance_m(), std::abs(wall.plane.yaw_rad()) / degree,
      std::abs(wall.plane.pitch_rad()) / degree, wall.plane.pitch_rad() > 0.0 ? "up" : "down",
      wall.deviation_codes);
}

}  // namespace

LiveCalibration::LiveCalibration(const LiveTopics& topics, const std::string& device,
                                 const GuidedCalibrationConfig& config, const GuidedStart& start,
                                 WallFolder* folder, TerminalPrompt* prompt)
    : device_(device),
      wall_(topics, start.range_finder),
      commander_(topics.command),
      guide_(config, start),
      folder_(*folder),
      prompt_(*prompt),
      corrector_(DepthCorrectionConfig{}) {}

bool LiveCalibration::run() {
  wait_for_clock();
  const ros::Time start = ros::Time::now();
  const int before = guide_.finished_count();
  status_.print(fmt::format(
      "{} of {} distances are done; next: {:.2f} m. calibration_view shows where the range finder "
      "must point.",
      before, guide_.total_count(), guide_.target_m()));
  while (ros::ok()) {
    if (interrupted()) return false;
    spin_for(kStep_s);
    watch_clock();
    if (!one_step()) continue;
    status_.print(fmt::format("{} distances in {:.0f} s.", guide_.finished_count() - before,
                              (ros::Time::now() - start).toSec()));
    return true;
  }
  return false;
}

/// Ages are told by ROS time: if it stands still, nothing would ever be stale.
void LiveCalibration::watch_clock() {
  const ros::WallTime now = ros::WallTime::now();
  if (ros::Time::now() != clock_) {
    clock_ = ros::Time::now();
    clock_moved_ = now;
  } else if ((now - clock_moved_).toSec() > kClockStands_s) {
    throw UserError(
        fmt::format("/use_sim_time is set, and /clock has stood still for {:.0f} s: has the simulator or the "
                    "playback ended?",
                    kClockStands_s));
  }
}

/// @return true when done
bool LiveCalibration::one_step() {
  GuidedInput input = wall_.take(ros::Time::now().toSec());
  if (state_ == GuidedState::kAsk) input.typed_m = typed();
  const GuidedStep step = guide_.step(input);
  commander_.send(step.forward_mps, step.turn_radps);
  if (step.drop_frames) kept_.clear();
  if (step.keep_frame) kept_.push_back(wall_.raw().clone());
  if (!step.notice.empty()) status_.print(step.notice);
  if (step.state != state_) announce(step);
  state_ = step.state;
  status_.show(line_of(step));
  wall_.show({line_of(step), measured_line(input), last_});
  if (step.finished) keep(*step.finished);
  if (step.state == GuidedState::kFailed) throw UserError(step.text);
  return step.state == GuidedState::kDone;
}

std::optional<double> LiveCalibration::typed() {
  const auto line = prompt_.poll_line();
  if (!line) return std::nullopt;
  const auto distance_m = parse_distance_m(*line);
  if (!distance_m)
    status_.print(fmt::format("'{}' is no distance in metres, such as 0.815; type it again:", *line));
  return distance_m;
}

void LiveCalibration::announce(const GuidedStep& step) {
  if (step.state == GuidedState::kPaused) status_.print("Standing: " + step.text);
  if (step.state == GuidedState::kAsk && !status_.on_terminal()) status_.print(step.text + ":");
}

std::string LiveCalibration::line_of(const GuidedStep& step) const {
  // The question ends where the answer is typed.
  const char* const end = step.state == GuidedState::kAsk ? ": " : "";
  return fmt::format("distance {} of {}: {}{}", std::min(guide_.finished_count() + 1, guide_.total_count()),
                     guide_.total_count(), step.text, end);
}

/// The fit's own test of each frame comes first, so that it will not refuse the folder later.
void LiveCalibration::keep(const GuidedDistance& finished) {
  try {
    DepthCalibrator probe{DepthCalibratorConfig{}};
    for (const cv::Mat& frame : kept_) {
      if (!corrector_.correct(frame, wall_.camera(), &depth_m_)) throw UserError(corrector_.fault());
      probe.add_frame(depth_m_, wall_.camera().rectified, finished.distance_m);
    }
  } catch (const UserError& error) {
    kept_.clear();
    return guide_.refuse(error.what());
  }
  folder_.set_camera(wall_.camera(), device_);
  folder_.add(kept_, finished.distance_m);
  kept_.clear();
  guide_.accept();
  const std::string how = finished.readings > 0
                              ? fmt::format("{} ranges, sd {:.1f} mm", finished.readings, 1e3 * finished.sd_m)
                              : std::string("typed");
  const std::string measured =
      fmt::format("{:.3f} m ({}), depth {:.3f} m, {:.2f} deg off square", finished.distance_m, how,
                  finished.depth_m, std::abs(finished.off_square_deg));
  last_ = "last: " + measured;
  status_.print(
      fmt::format("distance {} of {}: {}", guide_.finished_count(), guide_.total_count(), measured));
}

}  // namespace knav
