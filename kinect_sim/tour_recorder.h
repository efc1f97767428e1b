#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/trajectory.h"
#include "kinect_sim/simulator.h"
#include "kinect_sim/tour.h"

namespace rosbag {
class Bag;
}

namespace knav {

/// What goes into the recording of a tour.
struct RecordingOptions {
  double depth_s = 0.0;  ///< raw depth for the first so many seconds; +Inf = all, 0 = none
  bool depth_standing_only = false;  ///< of these, the frames taken while the robot stands still
  bool lidar = false;    ///< lidar_scan at 10 Hz
  bool range = false;    ///< range: the distance straight ahead of the camera, at 10 Hz
  double odom_rate_hz = 50.0;
};

struct TourResult {
  double duration_s = 0.0, distance_m = 0.0;
  std::uint64_t depth_frames = 0;
  std::vector<std::string> marks;
  ContactCount contacts;
  Trajectory truth, odometry;  ///< T_world_base, T_odom_base at the odometry's rate
};

/// What somebody who watches a tour is told, in the order of time. Empty ones are not called.
struct TourObserver {
  std::function<void()> odometry;                        ///< at odometry's rate
  std::function<void(const std::string& name)> mark;     ///< the button was pressed
  std::function<bool(const FrameRequest& request)> frame;  ///< a frame was read out; true if it counts as recorded
};

/// The robot of a tour is stuck: the script leads it against something, or people stand in its way for good.
class NoHeadway : public UserError {
 public:
  using UserError::UserError;
};

/// Drives a script through a world in lock-step, with a progress line. NoHeadway if the robot gets stuck.
/// @param limit_s  stops after so many simulated seconds
TourResult run_tour(Simulator& simulator, const TourScript& script, double odom_rate_hz, double limit_s,
                    const TourObserver& observer);

/// Drives a script through a world in lock-step, with a progress line, and writes what happens to a bag
/// (null: to none). NoHeadway if the robot gets stuck.
TourResult run_tour(Simulator& simulator, const TourScript& script, const RecordingOptions& options,
                    rosbag::Bag* bag);

}  // namespace knav
