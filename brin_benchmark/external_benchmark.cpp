#include "brin_benchmark/external_benchmark.h"

#include <ros/ros.h>

#include <memory>

#include "brin_benchmark/external_robot.h"
#include "core/error.h"

namespace knav {
namespace {

/// The node: one simulation and one stack for all runs.
struct ExternalBenchmark {
  explicit ExternalBenchmark(const ExternalOptions& o) : options(o), simulation(o), stack(&simulation.pacer(), o.wait_topic) {
    spinner.start();
  }
  ExternalOptions options;
  ros::AsyncSpinner spinner{1};
  ExternalSimulation simulation;
  ExternalStack stack;
};

void check_master() {
  if (!ros::master::check()) {
    throw UserError("no ROS master answers at " + ros::master::getURI() + ": start roscore, or the launch file of your stack.");
  }
  bool simulated_time = false;
  if (!ros::param::get("/use_sim_time", simulated_time) || !simulated_time) {
    throw UserError(
        "/use_sim_time is not true, so the stack would not follow the simulator's clock: `rosparam set use_sim_time true` "
        "before the stack starts.");
  }
}

}  // namespace

RobotFactory external_robots(const ExternalOptions& options) {
  // At the first run: a folder that has all of them needs no master.
  return [options, benchmark = std::shared_ptr<ExternalBenchmark>()](
             const SimulatorConfig& simulator, const WorldConfig& world, FlightRecorder*) mutable {
    if (!benchmark) {
      check_master();
      benchmark = std::make_shared<ExternalBenchmark>(options);
    }
    return std::make_unique<ExternalRobot>(&benchmark->simulation, &benchmark->stack, benchmark->options.ready_within_s,
                                           simulator, world);
  };
}

}  // namespace knav
