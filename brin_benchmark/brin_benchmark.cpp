// brin_benchmark: maps a simulated building, sends the robot through its waypoints, scores it as the paper did.
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "brin_benchmark/benchmark.h"
#include "core/config.h"
#include "core/progress.h"
#include "global_map_builder/build_map_config.h"
#include "ros_common/command_line.h"

namespace knav {
namespace {

struct Options {
  std::string world, changes, tour, config, calibration, out, sensor = "calibrated", odometry = "default";
  std::vector<std::string> sequence;
  int seed = 1;
};

const char* const kJsonHelp =
    R"(OUT/result.json holds failures, collisions (counts), time_s, distance_m, average_speed_mps,
mean_time_to_failure_s, mean_distance_to_failure_m (the whole run's if nothing failed), positioning_error_mean_m,
positioning_error_sd_m, seed, sensor, and legs: waypoint, reached, time_s, distance_m, positioning_error_m, reason.)";

nlohmann::json to_json(const BenchmarkResult& result, const Options& options) {
  nlohmann::json legs = nlohmann::json::array();
  for (const Leg& leg : result.legs) {
    nlohmann::json entry = {{"waypoint", leg.waypoint},
                            {"reached", leg.reached},
                            {"time_s", leg.time_s},
                            {"distance_m", leg.distance_m}};
    if (leg.reached) {
      entry["positioning_error_m"] = leg.positioning_error_m;
    } else {
      entry["reason"] = leg.reason;
    }
    legs.push_back(entry);
  }
  return {{"failures", result.failures},
          {"collisions", result.collisions},
          {"time_s", result.time_s},
          {"distance_m", result.distance_m},
          {"average_speed_mps", result.average_speed_mps},
          {"mean_time_to_failure_s", result.mean_time_to_failure_s},
          {"mean_distance_to_failure_m", result.mean_distance_to_failure_m},
          {"positioning_error_mean_m", result.positioning_error_mean_m},
          {"positioning_error_sd_m", result.positioning_error_sd_m},
          {"seed", options.seed},
          {"sensor", options.sensor},
          {"legs", legs}};
}

void run(const Options& options) {
  BenchmarkSetup setup;
  setup.mapping_world = load_world(options.world);
  setup.world = options.changes.empty() ? setup.mapping_world : load_world(options.changes);
  setup.tour = load_tour(options.tour);
  setup.sequence = options.sequence;
  if (setup.sequence.empty()) {
    for (const auto& place : setup.world.places) setup.sequence.push_back(place.first);
  }
  setup.simulator = read_config_section<SimulatorConfig>("", "simulator");
  setup.simulator.sensor = options.sensor;
  setup.simulator.odometry = options.odometry;
  setup.simulator.seed = options.seed;
  setup.stack = NavigationStackConfig::from_file(options.config);
  if (!options.calibration.empty()) setup.stack.front_end.depth_correction.calibration_file = options.calibration;
  setup.map_builder = read_config_section<BuildMapConfig>(options.config, "map_builder");

  std::string stage;
  std::unique_ptr<Progress> bar;
  const auto progress = [&](const std::string& now, double fraction) {
    stop_if_interrupted();
    if (now != stage) {
      bar = std::make_unique<Progress>(now);
      stage = now;
    }
    bar->update(fraction);
  };
  std::vector<Waypoint> waypoints;
  const BuiltMap built = map_world(setup, &waypoints, progress);
  const BenchmarkResult result = run_sequence(setup, built.map, waypoints, progress);
  bar.reset();

  std::error_code failed;
  std::filesystem::create_directories(options.out, failed);
  if (failed) throw UserError(options.out + ": cannot be made: " + failed.message() + ".");
  save_map(options.out + "/map", built.map, true);
  write_trajectory(options.out + "/truth.tum", result.truth);
  write_trajectory(options.out + "/estimate.tum", result.estimate);
  write_json(options.out + "/result.json", to_json(result, options).dump(2));
  for (const Leg& leg : result.legs) {
    fmt::print("{:<24} {}  {:6.1f} s  {:6.1f} m  {}\n", leg.waypoint, leg.reached ? "reached" : "FAILED ", leg.time_s,
               leg.distance_m, leg.reached ? fmt::format("{:.3f} m off", leg.positioning_error_m) : leg.reason);
  }
  fmt::print("{} failures, {} collisions, {:.1f} m in {:.0f} s ({:.2f} m/s), positioning error {:.3f} +- {:.3f} m\n",
             result.failures, result.collisions, result.distance_m, result.time_s, result.average_speed_mps,
             result.positioning_error_mean_m, result.positioning_error_sd_m);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(
      "Benchmark for Robotic Indoor Navigation, in simulation and lock-step: a mapping drive through the building, then\n"
      "the robot is sent through the waypoints. A waypoint not reached in its time is a failure.");
  knav::Options options;
  app.add_option("--world", options.world, "world of the mapping drive, e.g. config/worlds/brin_building.yaml")->required();
  app.add_option("--changes", options.changes, "world of the run, with people and changes; default: the same");
  app.add_option("--tour", options.tour, "script of the mapping drive, e.g. config/worlds/brin_tour.yaml")->required();
  app.add_option("--sequence", options.sequence, "names of places to visit in order; default: all of the world's");
  app.add_option("--config", options.config, "configuration file; default: the defaults");
  app.add_option("--calibration", options.calibration, "depth calibration of the simulated Kinect");
  app.add_option("--sensor", options.sensor, "sensor preset of the simulator")->capture_default_str();
  app.add_option("--odometry", options.odometry, "odometry preset of the simulator")->capture_default_str();
  app.add_option("--seed", options.seed, "of all noise")->check(CLI::NonNegativeNumber)->capture_default_str();
  app.add_option("--out", options.out, "folder for result.json, the map and the trajectories")->required();
  app.footer(knav::kJsonHelp);
  return knav::run_command(app, argc, argv, [&] { knav::run(options); });
}
