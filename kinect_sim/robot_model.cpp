#include "kinect_sim/robot_model.h"

#include <algorithm>
#include <cmath>

#include "core/random.h"

namespace knav {
namespace {

/// The pose after moving along an arc.
Pose2 along_arc(double distance_m, double turn_rad) {
  if (std::abs(turn_rad) < 1e-9) return {distance_m, 0.0, turn_rad};
  const double radius = distance_m / turn_rad;
  return {radius * std::sin(turn_rad), radius * (1.0 - std::cos(turn_rad)), turn_rad};
}

double approach(double value, double target, double step) {
  return value + std::clamp(target - value, -step, step);
}

}  // namespace

const std::vector<std::string>& OdometryErrors::preset_names() {
  static const std::vector<std::string> names = {"perfect", "default", "bad"};
  return names;
}

OdometryErrors OdometryErrors::preset(const std::string& name) {
  OdometryErrors errors;
  if (name == "perfect") return errors;
  if (name == "bad") {
    // mit_csail's raw wheel odometry: 9 degrees in 5 m, 2.2 m over 20 m.
    errors.distance_scale = 0.05;
    errors.turn_scale = 0.06;
    errors.turn_per_distance_radpm = 0.02;
    errors.distance_noise = 0.03;
    errors.turn_noise_rad = 0.06;
    errors.turn_noise_per_turn_rad = 0.05;
    return errors;
  }
  errors.distance_scale = 0.02;
  errors.turn_scale = 0.03;
  errors.turn_per_distance_radpm = 0.005;
  errors.distance_noise = 0.01;
  errors.turn_noise_rad = 0.012;
  errors.turn_noise_per_turn_rad = 0.02;
  return errors;
}

RobotModel::RobotModel(const RobotConfig& config, const OdometryErrors& errors, std::uint64_t seed,
                       std::uint64_t device_seed)
    : config_(config), errors_(errors), seed_(seed) {
  RandomStream device(device_seed, random_stream::kSimDevice, 1, 0);
  const auto sign = [&] { return device.uniform() < 0.5 ? -1.0 : 1.0; };
  errors_.distance_scale *= sign();
  errors_.turn_scale *= sign();
  errors_.turn_per_distance_radpm *= sign();
}

void RobotModel::set_command(double v_mps, double w_radps) {
  if (!std::isfinite(v_mps) || !std::isfinite(w_radps)) v_mps = w_radps = 0.0;
  command_v_ = std::clamp(v_mps, -config_.max_speed_mps, config_.max_speed_mps);
  command_w_ = std::clamp(w_radps, -config_.max_turn_radps, config_.max_turn_radps);
}

Pose2 RobotModel::wanted_pose(double dt_s, std::uint64_t step) {
  dt_s_ = dt_s;
  step_ = step;
  v_mps_ = approach(v_mps_, command_v_, config_.acceleration_mps2 * dt_s);
  w_radps_ = approach(w_radps_, command_w_, config_.turn_acceleration_radps2 * dt_s);
  // Slip drifts over about half a second.
  RandomStream random(seed_, random_stream::kSimOdometry, step, 0);
  const double keep = std::exp(-dt_s / 0.5), fresh = std::sqrt(1.0 - keep * keep) * config_.slip;
  slip_v_ = keep * slip_v_ + fresh * random.normal();
  slip_w_ = keep * slip_w_ + fresh * random.normal();
  distance_m_ = v_mps_ * (1.0 + slip_v_) * dt_s;
  turn_rad_ = w_radps_ * (1.0 + slip_w_) * dt_s;
  return T_world_base_ * along_arc(distance_m_, turn_rad_);
}

void RobotModel::advance() {
  T_world_base_ = T_world_base_ * along_arc(distance_m_, turn_rad_);
  measure(v_mps_ * dt_s_, w_radps_ * dt_s_);
}

void RobotModel::stay() {
  T_world_base_.yaw_rad = normalize_angle_rad(T_world_base_.yaw_rad + turn_rad_);
  v_mps_ = 0.0;
  measure(0.0, w_radps_ * dt_s_);
}

void RobotModel::measure(double distance_m, double turn_rad) {
  RandomStream random(seed_, random_stream::kSimOdometry, step_, 1);
  const double length = std::abs(distance_m), angle = std::abs(turn_rad);
  const double measured_m = distance_m * (1.0 + errors_.distance_scale) +
                            errors_.distance_noise * std::sqrt(length) * random.normal();
  const double measured_rad = turn_rad * (1.0 + errors_.turn_scale) +
                              errors_.turn_per_distance_radpm * distance_m +
                              errors_.turn_noise_rad * std::sqrt(length) * random.normal() +
                              errors_.turn_noise_per_turn_rad * std::sqrt(angle) * random.normal();
  T_odom_base_ = T_odom_base_ * along_arc(measured_m, measured_rad);
  if (dt_s_ <= 0.0) return;
  const double keep = std::exp(-dt_s_ / 0.05);  // encoders' speed is smoothed
  odometry_v_mps_ = keep * odometry_v_mps_ + (1.0 - keep) * measured_m / dt_s_;
  odometry_w_radps_ = keep * odometry_w_radps_ + (1.0 - keep) * measured_rad / dt_s_;
}

}  // namespace knav
