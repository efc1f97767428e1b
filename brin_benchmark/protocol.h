#pragma once

#include <string>
#include <vector>

#include "kinect_sim/world.h"

namespace knav {

/// One run of the sequence: what differs from the building that was mapped.
struct BenchmarkRun {
  std::string name;
  std::string changes;  ///< keys of a world file, as YAML; empty = nothing changed
};

/// What a changes file says (docs/benchmark.md has the keys): the way the robot is sent, and the changes of
/// every run.
struct BenchmarkProtocol {
  std::string file;
  std::string tour_file;              ///< script of the mapping drive
  std::vector<std::string> sequence;  ///< names of places, in the order they are visited
  std::vector<BenchmarkRun> runs;
};

/// UserError names file, line and key.
BenchmarkProtocol load_protocol(const std::string& path);

/// The building at a run: the world of `world_path` with the run's changes.
WorldConfig changed_world(const std::string& world_path, const BenchmarkProtocol& protocol,
                          const BenchmarkRun& run);

}  // namespace knav
