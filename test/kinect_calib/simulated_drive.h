#pragma once

#include <functional>
#include <limits>
#include <string>

#include "kinect_sim/simulator.h"
#include "kinect_sim/tour.h"

namespace knav {

/// config/worlds/setup_tour.yaml driven once, every second depth frame and odometry at 50 Hz handed to
/// whoever tests.
struct SimulatedDrive {
  SimulatorConfig config;
  double end_s = 1e9;  ///< of the simulation, from its start
  std::function<void(const cv::Mat& depth_m, const Simulator& simulator, double stamp_s)> frame;
  std::function<void(double stamp_s, const Pose2& T_odom_base)> odometry;

  void run() const {
    const std::string worlds = std::string(KINECT_NAV_SOURCE_DIR) + "/config/worlds/";
    Simulator simulator(load_world(worlds + "setup_room.yaml"), config);
    TourDriver driver(load_tour(worlds + "setup_tour.yaml"));
    double next_odometry_s = 0.0;
    cv::Mat depth_mm, depth_m;
    for (FrameRequest request; simulator.stamp_s() < config.start_time_s + end_s;) {
      const auto command = driver.step(simulator.stamp_s(), simulator.T_world_base());
      if (command.done) break;
      simulator.set_command(command.v_mps, command.w_radps);
      simulator.step();
      if (simulator.stamp_s() >= next_odometry_s) {
        next_odometry_s = simulator.stamp_s() + 0.02 - 1e-6;
        odometry(simulator.stamp_s(), simulator.T_odom_base());
      }
      if (!simulator.next_frame(&request) || request.index % 2 != 0) continue;
      simulator.render(request, &depth_mm);
      depth_mm.convertTo(depth_m, CV_32F, 1e-3);
      depth_m.setTo(std::numeric_limits<float>::quiet_NaN(), depth_mm == 0);
      frame(depth_m, simulator, request.stamp_s);
    }
  }
};

/// A camera that is not where one would like it.
inline SimulatorConfig tilted_camera() {
  SimulatorConfig config;
  config.sensor = "calibrated";
  config.camera_height_m = 0.43;
  config.camera_forward_m = 0.12;
  config.camera_pitch_deg = 4.0;
  config.camera_roll_deg = -2.0;
  config.camera_yaw_deg = 3.0;
  return config;
}

}  // namespace knav
