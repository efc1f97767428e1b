#pragma once

#include <cstddef>
#include <opencv2/core.hpp>

#include "brin_benchmark/flight_recorder.h"
#include "brin_benchmark/navigation_stack.h"
#include "brin_benchmark/ticker.h"
#include "core/trajectory.h"
#include "kinect_sim/simulator.h"

namespace knav {

/// The robot, its stack and the building, advanced together in lock-step.
class ClosedLoop {
 public:
  /// @param recorder  shown every frame, may be null
  ClosedLoop(const SimulatorConfig& simulator, const NavigationStackConfig& stack, const WorldConfig& world,
             const MapDirectory& map, FlightRecorder* recorder);

  /// T_world_robot and T_map_robot go there from now on, at 10 Hz.
  void record(Trajectory* truth, Trajectory* estimate);

  Simulator& simulator() { return simulator_; }
  const Simulator& simulator() const { return simulator_; }
  NavigationStack& stack() { return stack_; }
  const NavigationStack& stack() const { return stack_; }
  double now_s() const { return simulator_.stamp_s(); }

  /// One physics step, with all that falls due. Returns the newest command.
  const Command& step();

  /// Tells the stack where the robot stands, and lets it look for a second.
  void start(const Pose2& T_map_robot);
  /// Sets the robot down, says so, and lets it look for a second; beside the pose if something stands on it. False if there
  /// is no room within 2 m.
  bool place_near(const Pose2& T_world_robot, const Pose2& T_map_robot);
  /// Carries the robot elsewhere and tells nobody. False if something stands there, or nearer than `room_m` to it.
  bool kidnap(const Pose2& T_world_robot, double room_m = 0.0);

  /// Of the robot's own work (all but the simulation), a frame.
  double frame_cost_ms() const { return frames_ > 0 ? 1e3 * stack_s_ / static_cast<double>(frames_) : 0.0; }
  /// The same by stage.
  StageTable stage_cost_ms() const { return stack_.costs().per_frame_ms(frames_); }

  /// The longest control step, planning included.
  double control_max_ms() const { return 1e3 * control_max_s_; }

 private:
  void settle();
  void add_odometry();

  Simulator simulator_;
  NavigationStack stack_;
  FlightRecorder* recorder_;
  Trajectory *truth_ = nullptr, *estimate_ = nullptr;
  double stack_s_ = 0.0, control_max_s_ = 0.0;
  std::size_t frames_ = 0;
  FrameRequest request_;
  cv::Mat depth_;
  Command command_;
  Ticker odometry_, control_, track_;
  Pose2 last_T_odom_;
  double last_odometry_s_ = 0.0;
};

}  // namespace knav
