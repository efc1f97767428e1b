#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <fstream>
#include <map>

#include "brin_benchmark/configurations.h"
#include "brin_benchmark/session.h"
#include "core/error.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

const char* const kRoom = R"(
name: room
wall_height_m: 2.5
wall_thickness_m: 0.12
spawn: [0, 0, 0]
walls:
  - points: [[-1.5, -2], [4.5, -2], [4.5, 2], [-1.5, 2], [-1.5, -2]]
boxes:
  - {name: crate, at: [1.6, -1.4], size: [0.8, 0.6, 0.8]}
  - {name: shelf, at: [4.2, 1.0], size: [0.4, 1.2, 1.8]}
places:
  near: [1.0, 0.0, 0]
  far: [2.8, 0.0, 0]
)";

const char* const kTour = R"(
speed_mps: 0.6
turn_radps: 0.9
steps:
  - drive: [[1.0, 0.0], [2.8, 0.0]]
  - face: 180
  - drive: [[0.0, 0.0]]
  - face: 0
)";

BenchmarkSetup room_setup() {
  BenchmarkSetup setup;
  setup.world = parse_world(kRoom, "room.yaml");
  setup.tour = parse_tour(kTour, "tour.yaml");
  setup.sequence = {"far", "near"};
  setup.simulator.sensor = "calibrated";
  return setup;
}

TEST(Benchmark, RobotMapsARoomReachesItsWaypointsAndASecondSessionDrivesNothingAgain) {
  const std::string folder = testing::TempDir() + "benchmark_session";
  fs::remove_all(folder);
  fs::create_directories(folder);
  std::ofstream(folder + "/room.yaml") << kRoom;
  std::ofstream(folder + "/tour.yaml") << kTour;
  std::ofstream(folder + "/changes.yaml")
      << "tour: tour.yaml\nsequence: [far, near]\nruns:\n"
         "  - {name: moved, moved: [{from: [1.6, -1.4], to: [1.8, -1.5, 10]}]}\n";
  SessionOptions options;
  options.world = folder + "/room.yaml";
  options.changes = folder + "/changes.yaml";
  options.out = folder + "/out";
  const auto quiet = [](const std::string&, double, const std::string&) {};
  {
    BenchmarkSession session(options);
    session.map(quiet);
    session.run({}, quiet);
    const std::vector<RunResult> runs = session.results();
    ASSERT_EQ(runs.size(), 1u);
    EXPECT_EQ(runs[0].name, "moved");
    ASSERT_EQ(runs[0].legs.size(), 2u);
    for (const Leg& leg : runs[0].legs) {
      EXPECT_TRUE(leg.reached) << leg.waypoint << ": " << leg.reason;
      // Goal tolerance 0.05 m plus three times the 0.05 m that localization is asked for in a furnished
      // building.
      EXPECT_LT(leg.positioning_error_m, 0.20) << leg.waypoint;
    }
    EXPECT_EQ(runs[0].collisions, 0u);
    EXPECT_GT(runs[0].distance_m, 4.0);
    // The stages are all of the robot's work but for the calls between them.
    ASSERT_EQ(runs[0].stage_cost_ms.size(), kStages);
    double sum_ms = 0.0;
    for (const auto& [stage, cost_ms] : runs[0].stage_cost_ms) {
      EXPECT_GT(cost_ms, 0.0) << stage;
      sum_ms += cost_ms;
    }
    EXPECT_LE(sum_ms, runs[0].frame_cost_ms);
    EXPECT_GT(sum_ms, 0.8 * runs[0].frame_cost_ms);
    write_report(options.out, runs, {"a test"});
  }
  for (const char* file :
       {"run_01.json", "run_01.png", "run_01_truth.tum", "report.json", "report.md", "map/map.yaml"}) {
    EXPECT_TRUE(fs::exists(options.out + "/" + file)) << file;
  }
  {
    int stages = 0;
    BenchmarkSession again(options);
    const auto count = [&](const std::string&, double, const std::string&) { ++stages; };
    again.map(count);
    again.run({}, count);
    EXPECT_EQ(stages, 0) << "all of it was there";
    EXPECT_EQ(again.results().size(), 1u);
  }
  options.seed = 2;
  EXPECT_THROW(BenchmarkSession{options}, UserError) << "another seed is another benchmark";
  fs::remove_all(folder);
}

/// "a/b/c" -> value, of every scalar.
void flatten(const YAML::Node& node, const std::string& path, std::map<std::string, std::string>* values) {
  if (!node.IsMap()) {
    (*values)[path] = YAML::Dump(node);
    return;
  }
  for (const auto& entry : node) flatten(entry.second, path + "/" + entry.first.as<std::string>(), values);
}

TEST(Configurations, ThePapersTwoRunsDifferInTheTwoKeysOnly) {
  std::map<std::string, std::string> full, baseline;
  flatten(YAML::LoadFile(configuration_file("paper_full")), "", &full);
  flatten(YAML::LoadFile(configuration_file("paper_baseline")), "", &baseline);
  std::vector<std::string> different;
  for (const auto& [key, value] : full) {
    if (baseline[key] != value) different.push_back(key);
  }
  EXPECT_EQ(full.size(), baseline.size());
  EXPECT_EQ(different, (std::vector<std::string>{"/navigation/local_map", "/navigation/localize_with"}));
  // The literal one has the same localizer.
  const std::string literal_file = configuration_file("paper_literal");
  EXPECT_EQ(YAML::Dump(YAML::LoadFile(literal_file)["localizer"]), YAML::Dump(YAML::LoadFile(configuration_file("paper_full"))["localizer"]));
  // And both are good configurations.
  EXPECT_FALSE(NavigationStackConfig::from_file(configuration_file("paper_baseline")).input.local_map);
  EXPECT_EQ(NavigationStackConfig::from_file(literal_file).local_mapper.filter.alignment_cost, "paper");
  EXPECT_EQ(configuration_file("default"), "");
  EXPECT_THROW(configuration_file("papper"), UserError);
}

TEST(Configurations, TheShippedFileWithTheNodeletsKeysIsTakenToo) {
  const std::string paper = configuration_file("paper_full");
  const std::string shipped = paper.substr(0, paper.rfind('/')) + "/default.yaml";
  EXPECT_EQ(NavigationStackConfig::from_file(shipped).localizer.max_particles, LocalizerConfig{}.max_particles);
}

TEST(Benchmark, PlaceOffTheTourIsRefusedByName) {
  BenchmarkSetup setup = room_setup();
  setup.sequence = {"nowhere"};
  std::vector<Waypoint> waypoints;
  setup.tour.steps.resize(1);
  setup.tour.steps[0].path = {{0.5, 0.0}};
  EXPECT_THROW(map_world(setup, &waypoints, [](const std::string&, double) {}), UserError);
  setup.sequence = {"far"};
  setup.waypoint_within_m = 0.5;
  EXPECT_THROW(map_world(setup, &waypoints, [](const std::string&, double) {}), UserError);
}

}  // namespace
}  // namespace knav
