#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "brin_benchmark/benchmark.h"
#include "brin_benchmark/goal_report.h"

namespace knav {

struct GoalSessionOptions {
  std::string world, tour, map, config, calibration, out;
  std::string sensor = "calibrated", odometry = "default";
  bool true_map = false;  ///< a map of the walls as they are instead of a mapping drive
  GoalSuiteConfig suite;
  int run = 0;  ///< counted from 1; 0 = all
  bool quick = false;
  int jobs = 1;
};

/// Goals in one building, in a folder: the map first (driven, true, or `map` taken over), then the goals, then the runs, each written whole when it ends.
///
///   setup.json                      what it is of; another one is refused
///   map/, suite.json                of the mapping drive (keepout painted in), and the goals that were drawn
///   run_01.json, .png, _truth.tum, _estimate.tum, and run_01_GOAL.bag for what went wrong
///   report.json, report.md
class GoalSession {
 public:
  using RecorderFactory = std::function<std::unique_ptr<FlightRecorder>(const std::string& path_stem)>;
  using SessionProgress = std::function<void(const std::string& stage, double fraction, const std::string& note)>;

  /// UserError if the options contradict each other or what the folder holds.
  explicit GoalSession(const GoalSessionOptions& options);

  /// Drives the mapping tour and draws the goals, unless the folder has them already.
  void map(const SessionProgress& progress);
  /// Drives the runs that the folder does not have yet.
  void run(const RecorderFactory& recorder, const SessionProgress& progress);

 private:
  MapDirectory make_map(const SessionProgress& progress) const;
  std::string stem(std::size_t run) const;
  void drive(std::size_t run, const RecorderFactory& recorder, const std::function<void(double)>& progress);

  GoalSessionOptions options_;
  BenchmarkSetup setup_;
  MapDirectory map_;
  std::unique_ptr<WorldInMap> world_in_map_;
  std::vector<SuiteRun> suite_;
};

/// The results in a session's folder. UserError if there is none.
std::vector<GoalRunResult> read_goal_results(const std::string& folder);
/// report.json and report.md over these results.
void write_goal_report(const std::string& folder, const std::vector<GoalRunResult>& runs, const std::vector<std::string>& about);

}  // namespace knav
