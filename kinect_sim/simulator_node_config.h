#pragma once

#include "kinect_sim/simulator_config.h"

namespace knav {

/// Parameters of the nodelet kinect_nav/Simulator, beside the simulated robot's own.
struct SimulatorNodeConfig : SimulatorConfig {
  std::string world;
  std::string mode = "realtime";
  std::string wait_topic = "scan_360";
  double wait_limit_s = 2.0;
  double odom_rate_hz = 50.0;
  double scan_rate_hz = 10.0;
  double perfect_scan_height_m = 0.5;
  std::string openni2_device;

  template <class Visitor>
  void visit(Visitor& v) {
    SimulatorConfig::visit(v);
    v.text("world", world, "Path of the world file.");
    v.choice("mode", mode, {"realtime", "lockstep"},
             "realtime: follows the wall clock and drops late frames; lockstep: waits for 'wait_topic'.");
    v.text("wait_topic", wait_topic,
           "lockstep: the topic whose message with a frame's stamp lets time go on.");
    v.number("wait_limit_s", wait_limit_s, 0.01, 600, "s",
             "lockstep: wall time to wait at most for each frame.");
    v.number("odom_rate_hz", odom_rate_hz, 1, 250, "Hz", "Odometry, its TF and the ground truth.");
    v.number("scan_rate_hz", scan_rate_hz, 1, 30, "Hz", "LIDAR and perfect scan, while somebody listens.");
    v.number("perfect_scan_height_m", perfect_scan_height_m, 0.02, 2, "m",
             "Height of the perfect scan's plane.");
    v.text("openni2_device", openni2_device,
           "Shows the Kinect as the OpenNI2 device kinect_nav_simulated/NAME instead of publishing its images. "
           "Empty: publishes them.");
  }
  std::vector<std::string> validate() const {
    // 'world' is asked for where it is needed: programs take it as an argument.
    std::vector<std::string> faults = SimulatorConfig::validate();
    if (!openni2_device.empty() && mode == "lockstep") {
      faults.push_back("'openni2_device' needs mode 'realtime': a device does not wait.");
    }
    return faults;
  }
};

}  // namespace knav
