#pragma once

#include <string>
#include <vector>

#include "kinect_sim/kinect_model.h"
#include "kinect_sim/robot_model.h"

namespace knav {

/// The simulated robot, its mounts and rates. Defaults: the robot of the demo.
struct SimulatorConfig {
  std::string sensor = "default";
  std::string odometry = "default";
  int seed = 1;
  int device_seed = 7;
  double start_time_s = 100.0;
  double step_s = 0.004;
  double frame_rate_hz = 30.0;
  double readout_s = 1.0 / 30.0;
  double stamp_row_px = 239.5;
  double camera_height_m = 0.50;
  double camera_forward_m = 0.05;
  double camera_pitch_deg = 0.0;
  double camera_roll_deg = 0.0;
  double camera_yaw_deg = 0.0;
  double laser_height_m = 0.30;
  double laser_forward_m = 0.10;
  RobotConfig robot;

  template <class Visitor>
  void visit(Visitor& v) {
    v.choice("sensor", sensor, KinectConfig::preset_names(), "How faulty the simulated Kinect is.");
    v.choice("odometry", odometry, OdometryErrors::preset_names(), "How wrong odometry is.");
    v.integer("seed", seed, 0, 2147483647, "", "Seed of all noise.");
    v.integer("device_seed", device_seed, 0, 2147483647, "",
              "Which Kinect and which robot: their systematic errors.");
    v.number("start_time_s", start_time_s, 1, 1e9, "s", "Stamp at which the simulation starts.");
    v.number("step_s", step_s, 0.001, 0.01, "s", "Physics step; the clock is published every second one.");
    v.number("frame_rate_hz", frame_rate_hz, 1, 30, "Hz", "Depth frames a second.");
    v.number("readout_s", readout_s, 0, 0.0334, "s",
             "First to last row (rolling shutter); 0 = global shutter.");
    v.number("stamp_row_px", stamp_row_px, 0, 479, "px", "The row whose time is the frame's stamp.");
    v.number("camera_height_m", camera_height_m, 0.1, 2, "m", "Camera above the floor.");
    v.number("camera_forward_m", camera_forward_m, -0.5, 0.5, "m", "Camera ahead of base_link.");
    v.number("camera_pitch_deg", camera_pitch_deg, -45, 45, "deg", "Positive looks down.");
    v.number("camera_roll_deg", camera_roll_deg, -45, 45, "deg", "About the viewing direction.");
    v.number("camera_yaw_deg", camera_yaw_deg, -180, 180, "deg", "Positive looks left.");
    v.number("laser_height_m", laser_height_m, 0.02, 2, "m", "LIDAR above the floor.");
    v.number("laser_forward_m", laser_forward_m, -0.5, 0.5, "m", "LIDAR ahead of base_link.");
    v.group("robot", robot, "The base.");
  }
  std::vector<std::string> validate() const {
    std::vector<std::string> faults;
    if (readout_s > 1.0 / frame_rate_hz + 1e-6)
      faults.push_back("'readout_s' is longer than a frame period.");
    return faults;
  }
};

}  // namespace knav
