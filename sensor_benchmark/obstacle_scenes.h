#pragma once

#include "sensor_benchmark/sections.h"

namespace knav {

/// Scenes that floor removal must not get wrong: a wall, a crowd and a box that fill the view as the robot
/// drives up to them; a low box, a table's edge, a sign overhead; stairs down.
nlohmann::json measure_obstacle_scenes(const SensorBenchmarkOptions& options, Devices* devices,
                                       std::vector<Check>* checks);

}  // namespace knav
