#pragma once

#include "brin_benchmark/benchmark_robot.h"
#include "brin_benchmark/closed_loop.h"

namespace knav {

/// This project's own stack, called in lock-step.
class LockStepRobot : public BenchmarkRobot {
 public:
  LockStepRobot(const SimulatorConfig& simulator, const NavigationStackConfig& stack, const WorldConfig& world,
                const MapDirectory& map, FlightRecorder* recorder)
      : loop_(simulator, stack, world, map, recorder) {}

  void record(Trajectory* truth, Trajectory* estimate) override { loop_.record(truth, estimate); }
  const Simulator& simulator() const override { return loop_.simulator(); }
  void start(const Pose2& T_map_robot) override { loop_.start(T_map_robot); }
  bool place_near(const Pose2& T_world_robot, const Pose2& T_map_robot) override {
    return loop_.place_near(T_world_robot, T_map_robot);
  }
  bool set_goal(const Pose2& T_map_goal) override { return loop_.stack().set_goal(T_map_goal); }
  void cancel() override { loop_.stack().cancel(); }
  GoalState step() override {
    const Command& command = loop_.step();
    if (!command.finished) return GoalState::kDriving;
    return command.activity == Activity::kReached ? GoalState::kReached : GoalState::kFailed;
  }
  std::string failure() const override { return loop_.stack().failure().reason; }
  double frame_cost_ms() const override { return loop_.frame_cost_ms(); }
  StageTable stage_cost_ms() const override { return loop_.stage_cost_ms(); }

 private:
  ClosedLoop loop_;
};

}  // namespace knav
