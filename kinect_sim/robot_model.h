#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/pose2.h"

namespace knav {

/// A differential drive base with a round footprint.
struct RobotConfig {
  double radius_m = 0.20;
  double height_m = 0.60;
  double max_speed_mps = 0.8;
  double max_turn_radps = 2.0;
  double acceleration_mps2 = 1.0;
  double turn_acceleration_radps2 = 4.0;
  double slip = 0.01;
  double command_timeout_s = 0.5;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("radius_m", radius_m, 0.05, 1, "m", "Footprint.");
    v.number("height_m", height_m, 0.1, 2, "m", "What is higher than this does not touch it.");
    v.number("max_speed_mps", max_speed_mps, 0.05, 3, "m/s", "Commands are cut to this.");
    v.number("max_turn_radps", max_turn_radps, 0.1, 10, "rad/s", "Commands are cut to this.");
    v.number("acceleration_mps2", acceleration_mps2, 0.05, 10, "m/s^2", "Limit, also when braking.");
    v.number("turn_acceleration_radps2", turn_acceleration_radps2, 0.1, 50, "rad/s^2",
             "Limit, also when braking.");
    v.number("slip", slip, 0, 0.2, "", "Share (sd) of the commanded speed that the wheels lose or gain.");
    v.number("command_timeout_s", command_timeout_s, 0.05, 60, "s", "Without a new command the robot stops.");
  }
  std::vector<std::string> validate() const { return {}; }
};

/// How odometry departs from the truth: systematic errors that the device seed gives a sign, and random ones.
struct OdometryErrors {
  double distance_scale = 0.0;  ///< relative
  double turn_scale = 0.0;      ///< relative
  double turn_per_distance_radpm = 0.0;
  double distance_noise = 0.0;           ///< sd [m] after 1 m, growing with the root of the distance
  double turn_noise_rad = 0.0;           ///< sd [rad] after 1 m
  double turn_noise_per_turn_rad = 0.0;  ///< sd [rad] after 1 rad

  /// default: a few per cent; bad: as mit_csail, 9 deg in 5 m; perfect: none.
  static OdometryErrors preset(const std::string& name);
  static const std::vector<std::string>& preset_names();
};

/// Truth and odometry of the base. Deterministic by seed.
class RobotModel {
 public:
  RobotModel(const RobotConfig& config, const OdometryErrors& errors, std::uint64_t seed,
             std::uint64_t device_seed);

  void set_command(double v_mps, double w_radps);
  /// Where the next step would take the robot; advance() or stay() must follow.
  Pose2 wanted_pose(double dt_s, std::uint64_t step);
  /// Goes there; the wheels have turned.
  void advance();
  /// Blocked: turns, but does not move on; the wheels stall.
  void stay();

  void set_pose(const Pose2& T_world_base) {
    T_world_base_ = T_world_base;
    v_mps_ = w_radps_ = 0.0;
  }
  /// Where odometry says the robot is; it goes on from there.
  void set_odometry(const Pose2& T_odom_base) { T_odom_base_ = T_odom_base; }
  const Pose2& T_world_base() const { return T_world_base_; }
  const Pose2& T_odom_base() const { return T_odom_base_; }
  double v_mps() const { return v_mps_; }
  double w_radps() const { return w_radps_; }
  double odometry_v_mps() const { return odometry_v_mps_; }
  double odometry_w_radps() const { return odometry_w_radps_; }

 private:
  void measure(double distance_m, double turn_rad);

  RobotConfig config_;
  OdometryErrors errors_;
  std::uint64_t seed_, step_ = 0;
  Pose2 T_world_base_, T_odom_base_;
  double command_v_ = 0.0, command_w_ = 0.0;
  double v_mps_ = 0.0, w_radps_ = 0.0, slip_v_ = 0.0, slip_w_ = 0.0;
  double dt_s_ = 0.0, distance_m_ = 0.0, turn_rad_ = 0.0;
  double odometry_v_mps_ = 0.0, odometry_w_radps_ = 0.0;
};

}  // namespace knav
