// navigation_benchmark: many goals in a simulated building that has changed, and how the planner did.
#include <fmt/format.h>

#include <ctime>
#include <filesystem>
#include <fstream>
#include <memory>

#include "brin_benchmark/configurations.h"
#include "brin_benchmark/failure_bag.h"
#include "brin_benchmark/goal_session.h"
#include "core/error.h"
#include "core/progress.h"
#include "ros_common/command_line.h"

namespace knav {
namespace {

const char* const kFooter =
    R"(Goals lie on the floor that the map knows: anywhere, and right beside tables, low boxes, glass and stairs, so that the straight
way to the next one leads across them. One in ten cannot be reached: behind the only door, which is closed, in a wall, on stairs,
outside; the robot must say so. Doors, furniture and boxes differ from the map, people walk about. Glass and stairs are painted
into the map's keepout mask. Further goals have the robot carried off on the way.
OUT receives map/ (of the mapping drive), suite.json (the goals, and each run's changes as a world file has them), run_NN.json,
.png (truth green, estimate red, crosses where it went wrong), _truth.tum, _estimate.tum, run_NN_GOAL.bag with the 30 s before
what went wrong, report.json and report.md. What OUT has already is not driven again; --merge puts several buildings together.
run_NN.json: goals[] with right, reached (false if it stands more than 1 m off in truth), failure_code, reason, time_s, came_near_s (until within 3 m of the door that closes it, -1 never), distance_m, standing_s, localization (over time_s, without
5 s after being carried off: ok_s, lost_s, ok_wrong_s, ...), carried_off, noticed_s, right_s (since then, -1 never), estimate_off_m and true_off_m from the goal, turned_round and sways (changes of mind), collisions, walker_contacts.
report.json: the sums, with the names of report.md.)";

std::string about_today() {
  std::string processor = "unknown processor";
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("model name", 0) != 0) continue;
    processor = line.substr(line.find(':') + 2);
    break;
  }
  const std::time_t now = std::time(nullptr);
  char day[16];
  std::tm parts{};
  gmtime_r(&now, &parts);
  std::strftime(day, sizeof(day), "%Y-%m-%d", &parts);
  return fmt::format("{}, {}, version {}", day, processor, KINECT_NAV_VERSION);
}

void report(const std::string& out, const std::vector<GoalRunResult>& runs, const std::vector<std::string>& about) {
  write_goal_report(out, runs, about);
  fmt::print("{}", goal_report_markdown(runs, about));
}

void drive(const GoalSessionOptions& options) {
  GoalSession session(options);
  std::string stage;
  std::unique_ptr<Progress> bar;
  const auto progress = [&](const std::string& now, double fraction, const std::string& note) {
    stop_if_interrupted();
    if (now != stage) {
      bar = std::make_unique<Progress>("navigation_benchmark: " + now);
      stage = now;
    }
    bar->update(fraction, note);
  };
  session.map(progress);
  session.run([](const std::string& stem) { return std::make_unique<FailureBag>(stem); }, progress);
  bar.reset();
  report(options.out, read_goal_results(options.out),
         {about_today(), fmt::format("world {}, {}", options.world, options.suite.unchanged ? "unchanged, nobody about" : fmt::format("{} people", options.suite.people)),
          fmt::format("config {}, sensor {}, odometry {}, seed {}{}", options.config.empty() ? "default" : options.config,
                      options.sensor, options.odometry, options.suite.seed,
                      std::string(options.true_map ? ", true map" : "") + (options.quick ? ", quick" : ""))});
}

void merge(const std::vector<std::string>& folders, const std::string& out) {
  std::vector<GoalRunResult> all;
  for (const std::string& folder : folders) {
    const auto runs = read_goal_results(folder);
    all.insert(all.end(), runs.begin(), runs.end());
  }
  std::filesystem::create_directories(out);
  report(out, all, {fmt::format("{}, merged from {} folders", about_today(), folders.size())});
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(
      "Many goals in a simulated building, in lock-step and with the whole chain from the Kinect's noise on: a mapping drive, "
      "then\nthe robot is sent about in a building that has changed. Collisions, goals reached, reasons for those that cannot be, "
      "speed,\nchanges of mind, and what happens when the robot is carried off.");
  knav::GoalSessionOptions options;
  knav::GoalSuiteConfig& suite = options.suite;
  std::vector<std::string> folders;
  auto* merging = app.add_option("--merge", folders, "put the runs in these folders together instead of driving");
  app.add_option("--world", options.world, "world of the mapping drive, e.g. config/worlds/demo_goals.yaml");
  app.add_option("--tour", options.tour, "script of the mapping drive; laid out by itself if there is none");
  app.add_option("--map", options.map, "map directory of this building, its origin at the world's spawn; instead of a mapping drive");
  app.add_flag("--true-map", options.true_map, "a map of the walls as they are; instead of a mapping drive");
  app.add_option("--config", options.config, "default, paper_full, paper_baseline, paper_literal, or a file")->default_str("default");
  app.add_option("--calibration", options.calibration, "depth calibration of the simulated Kinect");
  app.add_option("--sensor", options.sensor, "sensor preset of the simulator")->capture_default_str();
  app.add_option("--odometry", options.odometry, "odometry preset of the simulator")->capture_default_str();
  app.add_option("--runs", suite.runs, "buildings with changes of their own")->check(CLI::Range(1, 99))->capture_default_str();
  app.add_option("--goals", suite.goals, "over all runs")->check(CLI::Range(1, 10000))->capture_default_str();
  app.add_option("--kidnaps", suite.kidnaps, "further goals on the way to which the robot is carried off")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  app.add_option("--people", suite.people, "in every run; 0 = 3 to 6")->check(CLI::Range(0, 100))->capture_default_str();
  app.add_option("--run", options.run, "drive only this run, counted from 1; 0 = all")->capture_default_str();
  app.add_option("--jobs", options.jobs, "runs driven at a time")->check(CLI::Range(1, 256))->capture_default_str();
  app.add_flag("--unchanged", suite.unchanged, "the building is as it was mapped, and nobody walks about")->excludes("--people");
  app.add_option("--seed", suite.seed, "of goals, changes and all noise")->check(CLI::Range(0, 1000000))->capture_default_str();
  app.add_flag("--quick", options.quick, "one run, four goals and a kidnap");
  app.add_option("--out", options.out, "folder for map, goals, runs and report")->required();
  app.footer(knav::kFooter);
  return knav::run_command(app, argc, argv, [&] {
    if (*merging) return knav::merge(folders, options.out);
    if (options.world.empty()) throw knav::UserError("--world is missing; see --help.");
    options.config = knav::configuration_file(options.config);
    knav::drive(options);
  });
}
