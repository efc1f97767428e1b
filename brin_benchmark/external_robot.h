#pragma once

#include "brin_benchmark/benchmark_robot.h"
#include "brin_benchmark/external_simulation.h"
#include "brin_benchmark/external_stack.h"
#include "brin_benchmark/ticker.h"

namespace knav {

/// A run's robot that is driven by ROS nodes. Simulation and stack outlive it: the next run goes on with them.
class ExternalRobot : public BenchmarkRobot {
 public:
  /// Waits until the stack offers what the benchmark needs; UserError says what is missing.
  ExternalRobot(ExternalSimulation* simulation, ExternalStack* stack, double ready_within_s,
                const SimulatorConfig& config, const WorldConfig& world);

  void record(Trajectory* truth, Trajectory* estimate) override;
  const Simulator& simulator() const override { return simulation_->simulator(); }
  void start(const Pose2& T_map_robot) override;
  bool place_near(const Pose2& T_world_robot, const Pose2& T_map_robot) override;
  bool set_goal(const Pose2& T_map_goal) override;
  void cancel() override { stack_->cancel(); }
  GoalState step() override;
  std::string failure() const override { return failure_; }
  double frames_dropped() const override { return simulation_->frames_dropped(); }

 private:
  void advance();
  /// Time goes on until the condition holds; false if it does not within this wall time.
  template <class Condition>
  bool advance_until(const Condition& condition, double within_s);
  void await_stack();
  /// Says where the robot stands, and lets the stack look for a second.
  void say_pose(const Pose2& T_map_robot);

  ExternalSimulation* simulation_;
  ExternalStack* stack_;
  double ready_within_s_;
  SimulatorConfig config_;
  WorldConfig world_;
  Trajectory *truth_ = nullptr, *estimate_ = nullptr;
  Ticker track_{0.1};
  std::string failure_;
};

}  // namespace knav
