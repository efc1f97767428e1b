#include "brin_benchmark/goal_session.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "brin_benchmark/benchmark_folder.h"
#include "brin_benchmark/benchmark_report.h"
#include "brin_benchmark/protocol.h"
#include "brin_benchmark/run_jobs.h"
#include "brin_benchmark/truth_map.h"
#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"
#include "global_map_builder/build_map_config.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

constexpr double kTourSpacing_m = 4.0;

/// What two sessions must share to go on with each other's files.
nlohmann::json identity(const GoalSessionOptions& o) {
  const auto text = [](const std::string& path) { return path.empty() ? std::string() : read_text_file(path); };
  return {{"world", o.world},
          {"world_text", text(o.world)},
          {"tour_text", text(o.tour)},
          {"map", o.map},
          {"true_map", o.true_map},
          {"config", o.config},
          {"config_text", text(o.config)},
          {"calibration_text", text(o.calibration)},
          {"sensor", o.sensor},
          {"odometry", o.odometry},
          {"seed", o.suite.seed},
          {"runs", o.suite.runs},
          {"goals", o.suite.goals},
          {"kidnaps", o.suite.kidnaps},
          {"people", o.suite.people},
          {"unchanged", o.suite.unchanged}};
}

}  // namespace

GoalSession::GoalSession(const GoalSessionOptions& options) : options_(options) {
  if (options_.quick) {
    options_.suite.runs = 1;
    options_.suite.goals = 4;
    options_.suite.kidnaps = 1;
  }
  setup_.world = load_world(options_.world);
  if (!options_.tour.empty()) {
    setup_.tour = load_tour(options_.tour);
  } else {
    const FloorPlan plan(setup_.world, options_.suite.robot_radius_m);
    setup_.tour = parse_tour(make_tour(plan, setup_.world, setup_.world.places, kTourSpacing_m), "the tour laid out");
  }
  setup_.simulator = read_config_section<SimulatorConfig>("", "simulator");
  setup_.simulator.sensor = options_.sensor;
  setup_.simulator.odometry = options_.odometry;
  setup_.simulator.seed = options_.suite.seed;
  setup_.stack = NavigationStackConfig::from_file(options_.config);
  if (!options_.calibration.empty()) setup_.stack.front_end.depth_correction.calibration_file = options_.calibration;
  setup_.map_builder = read_config_section<BuildMapConfig>(options_.config, "map_builder");
  if (options_.run < 0 || options_.run > options_.suite.runs) {
    throw UserError(fmt::format("--run {}: there are {} runs.", options_.run, options_.suite.runs));
  }
  if (options_.true_map && !options_.map.empty()) throw UserError("--true-map and --map: choose one map.");
  claim_folder(options_.out, identity(options_), "goals");
}

std::string GoalSession::stem(std::size_t run) const { return fmt::format("{}/run_{:02}", options_.out, run + 1); }

MapDirectory GoalSession::make_map(const SessionProgress& progress) const {
  if (!options_.map.empty()) return load_map(options_.map);
  if (options_.true_map) return truth_map_directory(setup_.world);
  std::vector<Waypoint> none;
  return map_world(setup_, &none, [&](const std::string& stage, double fraction) {
           progress(stage, fraction, fmt::format("{:.0f} m", setup_.tour.length_m()));
         }).map;
}

void GoalSession::map(const SessionProgress& progress) {
  const std::string folder = options_.out + "/map", file = options_.out + "/suite.json";
  // A map's origin is where its drive began.
  const Pose2 T_world_map = options_.true_map ? Pose2{} : setup_.world.spawn;
  if (!is_map_directory(folder)) {
    MapDirectory made = make_map(progress);
    paint_keepout(setup_.world, WorldInMap(setup_.world, made, T_world_map), &made);
    save_map(folder, made, true);
  }
  map_ = load_map(folder);
  world_in_map_ = std::make_unique<WorldInMap>(setup_.world, map_, T_world_map);
  if (!fs::exists(file)) {
    progress("drawing goals", 0.0, "");
    const std::vector<SuiteRun> drawn = draw_goals(setup_.world, map_, *world_in_map_, options_.suite);
    write_text_atomically(file, to_json(drawn).dump(1) + "\n");
  }
  suite_ = suite_from_json(read_json(file), file);
  BenchmarkProtocol protocol;
  protocol.file = file;
  for (const SuiteRun& run : suite_) changed_world(options_.world, protocol, {run.name, run.changes});
}

void GoalSession::drive(std::size_t k, const RecorderFactory& recorder, const std::function<void(double)>& progress) {
  const SuiteRun& run = suite_[k];
  SimulatorConfig simulator = setup_.simulator;
  // Every run has its own noise, whatever ran before it and in which process.
  simulator.seed = options_.suite.seed + 1000 * static_cast<int>(k + 1);
  BenchmarkProtocol protocol;
  protocol.file = options_.out + "/suite.json";
  const WorldConfig world = changed_world(options_.world, protocol, {run.name, run.changes});
  const std::unique_ptr<FlightRecorder> flight = recorder ? recorder(stem(k)) : nullptr;
  GoalRunRecord record = drive_goals(
      simulator, setup_.stack, world, map_, *world_in_map_, run,
      [&](const std::string&, double fraction) { progress(fraction); }, flight.get());
  write_trajectory(stem(k) + "_truth.tum", record.truth);
  write_trajectory(stem(k) + "_estimate.tum", record.estimate);
  std::vector<Waypoint> goals;
  for (const SuiteGoal& goal : run.goals) goals.push_back({goal.kind, *world_in_map_ * goal.T_world_goal, goal.T_world_goal});
  RunRecord drawn;
  drawn.truth = std::move(record.truth);
  drawn.estimate = std::move(record.estimate);
  drawn.failed_at = std::move(record.failed_at);
  write_run_picture(stem(k) + ".png", map_, goals, drawn);
  write_text_atomically(stem(k) + ".json", to_json(record.result).dump(1) + "\n");  // last: the run is whole
}

void GoalSession::run(const RecorderFactory& recorder, const SessionProgress& progress) {
  std::vector<std::size_t> missing;
  for (std::size_t k = 0; k < suite_.size(); ++k) {
    if (options_.run > 0 && k + 1 != static_cast<std::size_t>(options_.run)) continue;
    if (!fs::exists(stem(k) + ".json")) missing.push_back(k);
  }
  run_jobs(
      missing.size(), options_.jobs,
      [&](std::size_t i, const std::function<void(double)>& report) { drive(missing[i], recorder, report); },
      [&](double fraction) { progress("runs", fraction, fmt::format("{} to drive", missing.size())); });
}

std::vector<GoalRunResult> read_goal_results(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(folder, failed)) {
    const std::string name = entry.path().filename().string();
    if (name.size() == 11 && name.rfind("run_", 0) == 0 && entry.path().extension() == ".json") files.push_back(entry.path().string());
  }
  if (failed) throw UserError(folder + ": cannot be read: " + failed.message() + ".");
  if (files.empty()) throw UserError(folder + ": holds no run_NN.json; is it the folder of navigation_benchmark?");
  std::sort(files.begin(), files.end());
  std::vector<GoalRunResult> runs;
  for (const std::string& file : files) runs.push_back(goal_run_from_json(read_json(file), file));
  return runs;
}

void write_goal_report(const std::string& folder, const std::vector<GoalRunResult>& runs, const std::vector<std::string>& about) {
  nlohmann::json json = to_json(score(runs));
  json["about"] = about;
  for (const GoalRunResult& run : runs) json["each"].push_back(to_json(run));
  write_text_atomically(folder + "/report.json", json.dump(1) + "\n");
  write_text_atomically(folder + "/report.md", goal_report_markdown(runs, about));
}

}  // namespace knav
