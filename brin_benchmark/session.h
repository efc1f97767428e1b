#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "brin_benchmark/benchmark.h"
#include "brin_benchmark/protocol.h"

namespace knav {

struct SessionOptions {
  std::string world, changes, config, calibration, out;
  std::string sensor = "calibrated", odometry = "default";
  int seed = 1;
  int run = 0;         ///< counted from 1; 0 = all
  bool quick = false;  ///< one run, its first kQuickLegs legs
  int jobs = 1;        ///< runs at a time
  bool external = false;  ///< other software drives the runs; `config` is that of the mapping drive
  std::string goals;      ///< poses of the waypoints and of `start` in a map of the user's own; empty: as mapped
};

/// A benchmark in a folder: the map first, then the runs, each written whole when it ends, so that a session
/// that was interrupted goes on where it stopped.
///
///   setup.json                      what it is a benchmark of; another one is refused
///   map/, waypoints.json            of the mapping drive
///   run_01.json, .png, _truth.tum, _estimate.tum, and run_01_LEG.bag for a leg that failed
///   report.json, report.md          of all runs there are
class BenchmarkSession {
 public:
  static constexpr std::size_t kQuickLegs = 4;
  using RecorderFactory = std::function<std::unique_ptr<FlightRecorder>(const std::string& path_stem)>;
  /// Stage, fraction of it done, and a note for people; may throw to stop. Called from one thread at a time.
  using SessionProgress =
      std::function<void(const std::string& stage, double fraction, const std::string& note)>;

  /// UserError if the options contradict each other or what the folder holds.
  explicit BenchmarkSession(const SessionOptions& options);

  /// Drives the mapping tour, unless the folder has the map already.
  void map(const SessionProgress& progress);
  /// Drives the runs that the folder does not have yet.
  /// @param robot  makes the robot of each run; empty: this project's stack in lock-step
  void run(const RecorderFactory& recorder, const SessionProgress& progress, const RobotFactory& robot = {});

  /// The results of all runs in the folder, in order.
  std::vector<RunResult> results() const;

 private:
  std::vector<std::size_t> missing_runs() const;
  std::string stem(std::size_t run) const;
  void drive(std::size_t run, const RecorderFactory& recorder, const RobotFactory& robot,
             const std::function<void(double)>& progress);

  SessionOptions options_;
  BenchmarkProtocol protocol_;
  BenchmarkSetup setup_;
  MapDirectory map_;
  std::vector<Waypoint> waypoints_;
};

/// The same waypoints at their poses in another map, and where a run starts there.
/// @param places  a places.yaml with every waypoint's name and `start`; UserError names the one that is missing
std::vector<Waypoint> waypoints_on(const std::string& places, std::vector<Waypoint> waypoints, Pose2* T_map_start);

/// The results in a session's folder. UserError if there is none.
std::vector<RunResult> read_results(const std::string& folder);
/// report.json and report.md over these results.
void write_report(const std::string& folder, const std::vector<RunResult>& runs,
                  const std::vector<std::string>& about);

}  // namespace knav
