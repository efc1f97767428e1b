#pragma once

#include <functional>
#include <memory>
#include <string>

#include "brin_benchmark/flight_recorder.h"
#include "brin_benchmark/stage_costs.h"
#include "core/pose2.h"
#include "core/trajectory.h"
#include "kinect_sim/simulator.h"

namespace knav {

enum class GoalState { kDriving, kReached, kFailed };

/// A robot in its building with the software that drives it, as the protocol sees it: the same for a stack called in
/// lock-step and for one that runs as ROS nodes.
class BenchmarkRobot {
 public:
  virtual ~BenchmarkRobot() = default;

  /// T_world_robot, and where the stack believes it is, T_map_robot, go there from now on, at 10 Hz.
  virtual void record(Trajectory* truth, Trajectory* estimate) = 0;

  virtual const Simulator& simulator() const = 0;
  double now_s() const { return simulator().stamp_s(); }

  /// Tells the stack where the robot stands as a run begins, and lets it look for a second.
  virtual void start(const Pose2& T_map_robot) = 0;
  /// Sets the robot down, says so, and lets it look for a second; beside the pose if something stands on it. False if
  /// there is no room within 2 m.
  virtual bool place_near(const Pose2& T_world_robot, const Pose2& T_map_robot) = 0;

  /// False, with failure(), if the stack refuses at once.
  virtual bool set_goal(const Pose2& T_map_goal) = 0;
  virtual void cancel() = 0;
  /// One physics step, with all that falls due. What became of the goal is told once.
  virtual GoalState step() = 0;
  /// Why the goal was not reached.
  virtual std::string failure() const = 0;

  /// Of the stack's own work, a depth frame; 0 = not known.
  virtual double frame_cost_ms() const { return 0.0; }
  /// The same by stage; empty = not known.
  virtual StageTable stage_cost_ms() const { return {}; }
  /// Share of the depth frames that were not rendered in time.
  virtual double frames_dropped() const { return 0.0; }
};

/// Makes the robot of a run.
/// @param recorder  told of every frame if the robot can, may be null
using RobotFactory = std::function<std::unique_ptr<BenchmarkRobot>(
    const SimulatorConfig& simulator, const WorldConfig& world, FlightRecorder* recorder)>;

}  // namespace knav
