#pragma once

#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <vector>

#include "core/random.h"
#include "kinect_calib/guided_calibration.h"

namespace knav {

/// A robot before a wall whose normal is the x axis: it obeys cmd_vel with a lag, and its images come late.
struct WallRobot {
  explicit WallRobot(std::uint32_t seed = 0) : random_(1, random_stream::kTest, 8, seed) {}

  double distance_m = 0.6, yaw_rad = 0.0;  ///< of the camera, which sits on the base's axis
  double lag_s = 0.15, frame_delay_s = 0.08;
  double odometry_scale = 1.0, turn_sign = 1.0;
  bool blocked_behind = false, wheels_stall = false;  ///< the second: odometry notices
  double range_noise_m = 0.002, range_jump_m = 0.0;
  double slant_per_m = 0.0;  ///< the device's disparity error, linear across the image
  double finder_left_m = 0.0, finder_yaw_rad = 0.0;  ///< the range finder beside the axis, its beam askew
  bool silent_depth = false, silent_odometry = false, silent_range = false, somebody_walks_in = false;

  double now_s = 100.0;
  double forward_mps = 0.0, turn_radps = 0.0;
  double fastest_mps = 0.0, fastest_radps = 0.0;
  Pose2 T_odom_base;

  /// 0.01 s of its life; what it tells the guide.
  GuidedInput tick(const GuidedStep& command) {
    constexpr double kStep_s = 0.01;
    now_s += kStep_s;
    ++ticks_;
    forward_mps += (command.forward_mps - forward_mps) * kStep_s / lag_s;
    turn_radps += (turn_sign * command.turn_radps - turn_radps) * kStep_s / lag_s;
    fastest_mps = std::max(fastest_mps, std::abs(forward_mps));
    fastest_radps = std::max(fastest_radps, std::abs(turn_radps));
    const bool held = blocked_behind && forward_mps < 0.0;
    if (!held) distance_m -= forward_mps * kStep_s * std::cos(yaw_rad);
    yaw_rad += turn_radps * kStep_s;
    if (!(held && wheels_stall)) {
      T_odom_base = T_odom_base * Pose2{odometry_scale * forward_mps * kStep_s, 0.0, turn_radps * kStep_s};
    }
    input_.now_s = now_s;
    input_.new_frame = false;
    input_.ranges_m.clear();
    if (!silent_odometry && ticks_ % 2 == 0) {
      input_.odometry_stamp_s = now_s;
      input_.T_odom_base = T_odom_base;
    }
    if (!silent_range && ticks_ % 10 == 0) {
      const double jump_m = ticks_ % 20 == 0 ? range_jump_m : 0.0;
      const double finder_m =
          (distance_m + finder_left_m * std::sin(yaw_rad)) / std::cos(yaw_rad + finder_yaw_rad);
      input_.ranges_m.push_back(finder_m + random_.normal(0.0, range_noise_m) + jump_m);
    }
    if (ticks_ % 3 == 0) under_way_.push_back({now_s, view()});
    if (!under_way_.empty() && under_way_.front().stamp_s + frame_delay_s <= now_s) {
      if (!silent_depth) {
        input_.new_frame = true;
        input_.depth_stamp_s = under_way_.front().stamp_s;
        input_.wall = under_way_.front().view;
      }
      under_way_.pop_front();
    }
    return input_;
  }

 private:
  struct Frame {
    double stamp_s;
    SeenWall view;
  };

  /// Off by 1 % at 1 m, growing, as a device's error does.
  SeenWall view() {
    SeenWall view;
    const double tilt = std::tan(yaw_rad + random_.normal(0.0, 0.0005));
    const double per_m = std::cos(yaw_rad) / distance_m - 0.003;
    view.plane = {per_m, per_m * tilt + slant_per_m, 0.0};
    view.on_wall = 1.0;
    if (somebody_walks_in) view.fault = "the image's middle is no plane.";
    return view;
  }

  long ticks_ = 0;
  GuidedInput input_;
  std::deque<Frame> under_way_;
  RandomStream random_;
};

/// Runs the guide on the robot until it ends, or `until` says so, or ten simulated minutes have gone.
struct GuidedRun {
  GuidedCalibration guide;
  WallRobot& robot;
  GuidedStep step;
  std::vector<GuidedDistance> finished;
  std::vector<double> true_m, true_off_square_rad;
  std::vector<std::string> notices;
  int kept = 0;
  double answer_m = 0.0;  ///< typed when asked

  GuidedRun(const GuidedCalibrationConfig& config, const GuidedStart& start, WallRobot* on)
      : guide(config, start), robot(*on) {}

  void run(const std::function<bool()>& until = [] { return false; }) {
    for (int i = 0; i < 60000; ++i) {
      GuidedInput input = robot.tick(step);
      if (step.state == GuidedState::kAsk && answer_m > 0.0) input.typed_m = answer_m;
      step = guide.step(input);
      if (step.drop_frames) kept = 0;
      if (step.keep_frame) ++kept;
      if (!step.notice.empty()) notices.push_back(step.notice);
      if (step.finished) {
        finished.push_back(*step.finished);
        true_m.push_back(robot.distance_m);
        true_off_square_rad.push_back(robot.yaw_rad);
        kept_at.push_back(kept);
        kept = 0;
        guide.accept();
      }
      if (step.state == GuidedState::kDone || step.state == GuidedState::kFailed || until()) return;
    }
  }
  std::vector<int> kept_at;  ///< frames kept at each distance
};

}  // namespace knav
