// brin_benchmark: maps a simulated building, sends the robot through its waypoints while the building
// changes, and scores it as the paper did.
#include <fmt/format.h>
#include <ros/init.h>

#include <ctime>
#include <filesystem>
#include <fstream>
#include <memory>

#include "brin_benchmark/benchmark_report.h"
#include "brin_benchmark/configurations.h"
#include "brin_benchmark/external_benchmark.h"
#include "brin_benchmark/external_command_line.h"
#include "brin_benchmark/failure_bag.h"
#include "brin_benchmark/session.h"
#include "core/error.h"
#include "core/progress.h"
#include "ros_common/command_line.h"

namespace knav {
namespace {

const char* const kFooter =
    R"(OUT receives map/ and waypoints.json of the mapping drive; run_NN.json, .png (map with truth, estimate, failures as red
crosses), _truth.tum, _estimate.tum, and run_NN_LEG.bag with the 30 s before each failure; report.json and report.md.
What OUT has already is not driven again, so an interrupted benchmark goes on where it stopped; runs made apart with
--run K (GNU parallel, Slurm) are put together by --merge.
run_NN.json has collisions_at[]: time_s since the run began, x_m and y_m of the robot in the world. report.json: runs, legs, failures, collisions, walker_contacts (counts), time_s, distance_m, {mean,max}_time_to_failure_s,
{mean,max}_distance_to_failure_m, average_speed_mps, positioning_error_{mean,sd,max}_m, the 95 % intervals of
failures_per_run, speed_mps and positioning_error_m, and each run with its legs.
--config external starts simulator and scorer only, as a ROS node: it publishes /clock, odom, TF, the Kinect's images and
camera_info, sends initialpose and the goals to move_base, and takes cmd_vel. First --map-only, which needs no master; then
a master with /use_sim_time true and your stack on OUT/map/map.yaml; then the same command without --map-only.)";

std::string processor() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("model name", 0) == 0) return line.substr(line.find(':') + 2);
  }
  return "unknown processor";
}

std::string today() {
  const std::time_t now = std::time(nullptr);
  char text[16];
  std::tm day{};
  gmtime_r(&now, &day);
  std::strftime(text, sizeof(text), "%Y-%m-%d", &day);
  return text;
}

void print_summary(const std::vector<RunResult>& runs, const std::string& out) {
  const Score s = score(runs);
  for (const RunResult& run : runs) {
    for (const Leg& leg : run.legs) {
      if (!leg.reached) fmt::print("{}: {} FAILED: {}\n", run.name, leg.waypoint, leg.reason);
    }
  }
  fmt::print(
      "{} runs, {} legs: {} failures, {} collisions, {:.0f} m in {:.0f} s ({:.2f} m/s), positioning error "
      "{:.3f} +- {:.3f} "
      "m\n{}/report.md\n",
      s.runs, s.legs, s.failures, s.collisions, s.distance_m, s.time_s, s.average_speed_mps,
      s.positioning_error_mean_m, s.positioning_error_sd_m, out);
}

std::string how_driven(const SessionOptions& options, const ExternalOptions& external) {
  if (!options.external) return fmt::format("config {}", options.config.empty() ? "default" : options.config);
  std::string text = external.rate > 0.0 ? fmt::format("external stack at {} times real time", external.rate)
                                         : std::string("external stack, as fast as it follows");
  if (!external.wait_topic.empty()) text += ", waiting for " + external.wait_topic;
  if (external.lidar) text += ", with LIDAR";
  if (!options.goals.empty()) text += ", goals " + options.goals;
  return text;
}

void drive(const SessionOptions& options, const ExternalOptions& external, bool map_only) {
  BenchmarkSession session(options);
  std::string stage;
  std::unique_ptr<Progress> bar;
  const auto progress = [&](const std::string& now, double fraction, const std::string& note) {
    stop_if_interrupted();
    if (now != stage) {
      bar = std::make_unique<Progress>("brin_benchmark: " + now);
      stage = now;
    }
    bar->update(fraction, note);
  };
  session.map(progress);
  if (map_only) {
    bar.reset();
    if (options.external) fmt::print("{}", external_next_steps(options));
    return;
  }
  if (options.external) {
    // What the failure bags hold are the lock-step stack's insides.
    session.run({}, progress, external_robots(external));
  } else {
    session.run([](const std::string& stem) { return std::make_unique<FailureBag>(stem); }, progress);
  }
  bar.reset();
  const auto runs = session.results();
  write_report(options.out, runs,
               {fmt::format("{}, {}, version {}", today(), processor(), KINECT_NAV_VERSION),
                fmt::format("world {}, changes {}", options.world, options.changes),
                fmt::format("{}, sensor {}, odometry {}, seed {}{}", how_driven(options, external), options.sensor,
                            options.odometry, options.seed, options.quick ? ", quick" : "")});
  print_summary(runs, options.out);
}

void merge(const std::vector<std::string>& folders, const std::string& out) {
  std::vector<RunResult> all;
  for (const std::string& folder : folders) {
    const auto runs = read_results(folder);
    all.insert(all.end(), runs.begin(), runs.end());
  }
  std::filesystem::create_directories(out);
  write_report(out, all, {fmt::format("{}, merged from {} folders", today(), folders.size())});
  print_summary(all, out);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(
      "Benchmark for Robotic Indoor Navigation, in simulation and lock-step: a mapping drive through the "
      "building, then\n"
      "the robot is sent through the waypoints, again and again while the building changes. A waypoint not "
      "reached in its\n"
      "time is a failure.");
  knav::SessionOptions options;
  knav::ExternalOptions external;
  bool map_only = false;
  std::vector<std::string> folders;
  auto* merging =
      app.add_option("--merge", folders, "put the runs in these folders together instead of driving");
  app.add_option("--world", options.world,
                 "world of the mapping drive, e.g. config/worlds/brin_building.yaml");
  app.add_option("--changes", options.changes,
                 "sequence and changes of every run, e.g. config/worlds/brin_changes.yaml");
  app.add_option("--config", options.config, "default, paper_full, paper_baseline, paper_literal, external (another stack, as ROS nodes), or a file")
      ->default_str("default");
  app.add_option("--calibration", options.calibration, "depth calibration of the simulated Kinect");
  app.add_option("--sensor", options.sensor, "sensor preset of the simulator")->capture_default_str();
  app.add_option("--odometry", options.odometry, "odometry preset of the simulator")->capture_default_str();
  app.add_option("--run", options.run, "drive only this run, counted from 1; 0 = all")->capture_default_str();
  app.add_option("--jobs", options.jobs, "runs driven at a time")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  app.add_option("--seed", options.seed, "of all noise")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str();
  app.add_flag("--quick", options.quick, "one run, its first legs");
  app.add_flag("--map-only", map_only, "makes map and waypoints, and no runs");
  app.add_option("--out", options.out, "folder for map, runs and report")->required();
  const CLI::Option_group* group = knav::add_external_options(&app, &external, &options);
  app.footer(knav::kFooter);
  // Takes ROS's own arguments (remappings) away; reaches for no master.
  ros::init(argc, argv, "brin_benchmark", ros::init_options::NoSigintHandler);
  return knav::run_command(app, argc, argv, [&] {
    if (*merging) return knav::merge(folders, options.out);
    for (const auto& [name, value] :
         {std::pair{"--world", options.world}, std::pair{"--changes", options.changes}}) {
      if (value.empty()) throw knav::UserError(fmt::format("{} is missing; see --help.", name));
    }
    options.external = options.config == "external";
    options.config = options.external ? "" : knav::configuration_file(options.config);
    knav::check_external_options(*group, options);
    knav::drive(options, external, map_only);
  });
}
