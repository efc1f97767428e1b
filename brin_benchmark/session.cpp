#include "brin_benchmark/session.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "brin_benchmark/benchmark_folder.h"
#include "brin_benchmark/benchmark_report.h"
#include "brin_benchmark/lock_step_robot.h"
#include "brin_benchmark/run_jobs.h"
#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"
#include "global_map_builder/build_map_config.h"
#include "planner_tracker/places.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

nlohmann::json pose_json(const Pose2& pose) { return {pose.x_m, pose.y_m, pose.yaw_rad}; }
Pose2 pose_from(const nlohmann::json& json) { return {json.at(0), json.at(1), json.at(2)}; }

void write_waypoints(const std::string& path, const std::vector<Waypoint>& waypoints) {
  nlohmann::json list = nlohmann::json::array();
  for (const Waypoint& w : waypoints) {
    list.push_back({{"name", w.name},
                    {"map_x_y_yaw_m_rad", pose_json(w.T_map_robot)},
                    {"world_x_y_yaw_m_rad", pose_json(w.T_world_robot)}});
  }
  write_text_atomically(path, list.dump(1) + "\n");
}

std::vector<Waypoint> read_waypoints(const std::string& path) {
  std::vector<Waypoint> waypoints;
  try {
    for (const auto& entry : read_json(path)) {
      waypoints.push_back({entry.at("name"), pose_from(entry.at("map_x_y_yaw_m_rad")),
                           pose_from(entry.at("world_x_y_yaw_m_rad"))});
    }
  } catch (const nlohmann::json::exception& error) {
    throw UserError(path + ": is not a list of waypoints: " + error.what());
  }
  return waypoints;
}

/// What two sessions must share to go on with each other's files.
nlohmann::json identity(const SessionOptions& o) {
  const auto text = [](const std::string& path) {
    return path.empty() ? std::string() : read_text_file(path);
  };
  // A launch file that goes on where a command line began gives absolute paths.
  const auto named = [&](const std::string& path) {
    return o.external ? fs::weakly_canonical(path).string() : path;
  };
  return {{"world", named(o.world)},
          {"world_text", text(o.world)},
          {"changes", named(o.changes)},
          {"changes_text", text(o.changes)},
          {"config", o.external ? "external" : o.config},
          {"config_text", text(o.config)},
          {"calibration_text", text(o.calibration)},
          {"sensor", o.sensor},
          {"odometry", o.odometry},
          {"seed", o.seed},
          {"quick", o.quick}};
}

bool is_run_result(const fs::path& path) {
  const std::string name = path.filename().string();
  return name.size() == 11 && name.rfind("run_", 0) == 0 && path.extension() == ".json";
}

}  // namespace

BenchmarkSession::BenchmarkSession(const SessionOptions& options) : options_(options) {
  protocol_ = load_protocol(options.changes);
  setup_.world = load_world(options.world);
  setup_.tour = load_tour(protocol_.tour_file);
  setup_.sequence = protocol_.sequence;
  if (options.quick && setup_.sequence.size() > kQuickLegs) setup_.sequence.resize(kQuickLegs);
  setup_.simulator = read_config_section<SimulatorConfig>("", "simulator");
  setup_.simulator.sensor = options.sensor;
  setup_.simulator.odometry = options.odometry;
  setup_.simulator.seed = options.seed;
  setup_.stack = NavigationStackConfig::from_file(options.config);
  if (!options.calibration.empty())
    setup_.stack.front_end.depth_correction.calibration_file = options.calibration;
  setup_.map_builder = read_config_section<BuildMapConfig>(options.config, "map_builder");
  if (options.run < 0 || options.run > static_cast<int>(protocol_.runs.size())) {
    throw UserError(fmt::format("{}: has {} runs; there is no run {}.", options.changes,
                                protocol_.runs.size(), options.run));
  }
  // Every run's building is read now: a fault in the last one should not show after an hour.
  for (const BenchmarkRun& run : protocol_.runs) changed_world(options.world, protocol_, run);

  claim_folder(options.out, identity(options), "a benchmark");
}

std::string BenchmarkSession::stem(std::size_t run) const {
  return fmt::format("{}/run_{:02}", options_.out, run + 1);
}

void BenchmarkSession::map(const SessionProgress& progress) {
  const std::string folder = options_.out + "/map", file = options_.out + "/waypoints.json";
  if (!fs::exists(file)) {
    const BuiltMap built = map_world(setup_, &waypoints_, [&](const std::string& stage, double fraction) {
      progress(stage, fraction, fmt::format("{:.0f} m", setup_.tour.length_m()));
    });
    save_map(folder, built.map, true);
    write_waypoints(file, waypoints_);  // last: it says that the map is whole
  }
  map_ = load_map(folder);
  waypoints_ = read_waypoints(file);
}

std::vector<std::size_t> BenchmarkSession::missing_runs() const {
  std::vector<std::size_t> runs;
  for (std::size_t i = 0; i < protocol_.runs.size(); ++i) {
    if (options_.run > 0 && i + 1 != static_cast<std::size_t>(options_.run)) continue;
    if (!fs::exists(stem(i) + ".json")) runs.push_back(i);
    if (options_.quick && options_.run == 0) break;
  }
  return runs;
}

std::vector<Waypoint> waypoints_on(const std::string& places, std::vector<Waypoint> waypoints, Pose2* T_map_start) {
  const auto poses = load_places(places);
  const auto pose = [&](const std::string& name, const char* what) {
    const auto found = poses.find(name);
    if (found == poses.end())
      throw UserError(fmt::format("{}: no place '{}'; give {} there, in the frame of your map.", places, name, what));
    return found->second;
  };
  *T_map_start = pose("start", "where the mapping drive began (the world's 'spawn')");
  for (Waypoint& waypoint : waypoints) waypoint.T_map_robot = pose(waypoint.name, "the waypoint's pose");
  return waypoints;
}

void BenchmarkSession::drive(std::size_t run, const RecorderFactory& recorder, const RobotFactory& robot_factory,
                             const std::function<void(double)>& progress) {
  SimulatorConfig simulator = setup_.simulator;
  // Every run has its own noise, whatever ran before it and in which process.
  simulator.seed = options_.seed + 1000 * static_cast<int>(run + 1);
  const WorldConfig world = changed_world(options_.world, protocol_, protocol_.runs[run]);
  const std::unique_ptr<FlightRecorder> flight = recorder ? recorder(stem(run)) : nullptr;
  Pose2 T_map_start;  // the map's origin is where the mapping drive began
  const std::vector<Waypoint> goals =
      options_.goals.empty() ? waypoints_ : waypoints_on(options_.goals, waypoints_, &T_map_start);
  const std::unique_ptr<BenchmarkRobot> robot =
      robot_factory ? robot_factory(simulator, world, flight.get())
                    : std::make_unique<LockStepRobot>(simulator, setup_.stack, world, map_, flight.get());
  RunRecord record = run_sequence(
      *robot, T_map_start, goals, [&](const std::string&, double fraction) { progress(fraction); }, flight.get());
  record.result.name = protocol_.runs[run].name;
  write_trajectory(stem(run) + "_truth.tum", record.truth);
  write_trajectory(stem(run) + "_estimate.tum", record.estimate);
  // The picture is of the benchmark's own map.
  for (StampedPose2& pose : record.estimate) pose.T_map_robot = T_map_start.inverse() * pose.T_map_robot;
  write_run_picture(stem(run) + ".png", map_, waypoints_, record);
  write_text_atomically(stem(run) + ".json",
                        to_json(record.result).dump(1) + "\n");  // last: the run is whole
}

void BenchmarkSession::run(const RecorderFactory& recorder, const SessionProgress& progress,
                           const RobotFactory& robot) {
  const std::vector<std::size_t> runs = missing_runs();
  run_jobs(
      runs.size(), options_.jobs,
      [&](std::size_t k, const std::function<void(double)>& report) { drive(runs[k], recorder, robot, report); },
      [&](double fraction) { progress("runs", fraction, fmt::format("{} to drive", runs.size())); });
}

std::vector<RunResult> BenchmarkSession::results() const { return read_results(options_.out); }

std::vector<RunResult> read_results(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(folder, failed)) {
    if (is_run_result(entry.path())) files.push_back(entry.path().string());
  }
  if (failed) throw UserError(folder + ": cannot be read: " + failed.message() + ".");
  if (files.empty()) throw UserError(folder + ": holds no run_NN.json; is it the folder of a benchmark?");
  std::sort(files.begin(), files.end());
  std::vector<RunResult> runs;
  for (const std::string& file : files) runs.push_back(run_from_json(read_json(file), file));
  return runs;
}

void write_report(const std::string& folder, const std::vector<RunResult>& runs,
                  const std::vector<std::string>& about) {
  nlohmann::json json = to_json(score(runs));
  json["about"] = about;
  for (const RunResult& run : runs) json["each"].push_back(to_json(run));
  write_text_atomically(folder + "/report.json", json.dump(1) + "\n");
  write_text_atomically(folder + "/report.md", report_markdown(runs, about));
}

}  // namespace knav
