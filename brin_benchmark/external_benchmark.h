#pragma once

#include "brin_benchmark/benchmark_robot.h"
#include "brin_benchmark/external_options.h"

namespace knav {

/// Makes the robots of runs that another stack drives, as ROS nodes. Call ros::init() first; runs go one after the
/// other. The first robot is refused (UserError) if no master answers, or if the stack's clock would not be the simulator's.
RobotFactory external_robots(const ExternalOptions& options);

}  // namespace knav
