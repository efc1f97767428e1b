// mapper_benchmark: how accurate the local mapper is on simulated drives whose truth is known.
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "core/config.h"
#include "core/error.h"
#include "ros_common/command_line.h"
#include "tools/mapper_accuracy.h"
#include "tools/parked_accuracy.h"
#include "tools/simulated_recordings.h"

namespace knav {
namespace {

constexpr char kHelp[] =
    "Simulates drives of about 250 m (once; kept in --cache, about 50 MB each), maps them open loop and "
    "compares\n"
    "trajectory and virtual scan with the truth. Rows of the table:\n"
    "  ideal       a depth camera without faults: what the method alone costs\n"
    "  calibrated  a Kinect after calibration, odometry a few per cent wrong\n"
    "  driven      the same, but the robot begins with what another drive taught of its camera\n"
    "  default     a Kinect as bought, uncalibrated: up to 10 % wrong at 10 m\n"
    "  harsh       a bad one, uncalibrated: up to 16 %\n"
    "  paper       as calibrated, the local mapper as in --paper-config\n"
    "  people      as calibrated, with twenty people walking about\n"
    "  parked      the same people; the robot stands among them for half an hour, and drives on (15 min to simulate)";
constexpr char kJsonHelp[] =
    R"(The JSON holds, per row: seeds, worlds and sensor; runs[]: seed, segments."20", "50", "100" (metres of path):
{count, translation_mean_m, translation_mean_percent, translation_max_m, rotation_mean_deg}, odometry_segments (the
same of odometry alone), lost, epochs, path_m, duration_s, elapsed_s, lifespan_mean_s, scan: {rays,
error_median_m, error_p95_m, false_obstacle_percent, miss_percent}, parked (row parked): {parked_s, moved_m, turned_deg, later_m, seen_before,
seen_after}: how far the estimate of the standing robot went, its error 10 m later, and the share of what a perfect scanner sees
within 8 m that scan_360 shows, in the stop's first and last minute; mean: the runs' mean of the same, and
worst_to_mean_20_m. lost: some 20 m segment is more than 2 m off. scan: rays with evidence under 10 s; errors within
8 m; a false obstacle is a return 0.3 m and 5 % nearer than anything within 0.1 m beside its ray.)";

struct Options {
  std::string worlds = "config/worlds", cache, config = "config/simulated_robot.yaml", paper_config = "config/paper_literal.yaml", json, trajectories;
  std::vector<std::string> rows = {"calibrated", "driven", "harsh", "paper", "people"};
  int seeds = 10, first_seed = 1, mapper_seed = -1;
  bool quick = false, fresh = false, record_only = false, no_scans = false;
};

struct Row {
  std::string name, world = "brin_building.yaml", tour = "brin_tour.yaml", sensor = "calibrated";
  bool paper = false, driven = false;
};

Row row_named(const std::string& name) {
  Row row{name};
  if (name == "ideal" || name == "default" || name == "harsh") row.sensor = name;
  row.paper = name == "paper";
  row.driven = name == "driven";
  if (name == "people" || name == "parked") row.world = "brin_people.yaml";
  if (name == "parked") row.tour = "brin_parked_tour.yaml";
  return row;
}

nlohmann::json to_json(const ErrorStatistics& e, double length_m) {
  return {{"count", e.count},
          {"translation_mean_m", e.translation_mean_m},
          {"translation_mean_percent", 100.0 * e.translation_mean_m / length_m},
          {"translation_max_m", e.translation_max_m},
          {"rotation_mean_deg", e.rotation_mean_deg}};
}

double mean_of(const std::vector<double>& values) {
  return values.empty()
             ? std::numeric_limits<double>::quiet_NaN()
             : std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

nlohmann::json scan_json(const ScanAccuracy& scan) {
  const auto percent = [&](std::uint64_t count) {
    return 100.0 * static_cast<double>(count) / static_cast<double>(std::max<std::uint64_t>(1, scan.rays));
  };
  return {{"rays", scan.rays},
          {"error_median_m", scan.quantile_m(0.5)},
          {"error_p95_m", scan.quantile_m(0.95)},
          {"false_obstacle_percent", percent(scan.false_obstacles)},
          {"miss_percent", percent(scan.misses)}};
}

nlohmann::json run_json(int seed, const MapperAccuracy& a) {
  nlohmann::json json = {{"seed", seed},
                         {"lost", a.lost},
                         {"epochs", a.epochs},
                         {"path_m", a.path_m},
                         {"duration_s", a.duration_s},
                         {"elapsed_s", a.elapsed_s},
                         {"lifespan_mean_s", mean_of(a.lifespan_s)}};
  for (std::size_t k = 0; k < 3; ++k) {
    const std::string length = fmt::format("{:.0f}", MapperAccuracy::kLengths_m[k]);
    json["segments"][length] = to_json(a.segment[k], MapperAccuracy::kLengths_m[k]);
    json["odometry_segments"][length] = to_json(a.odometry_segment[k], MapperAccuracy::kLengths_m[k]);
  }
  if (a.scan.rays > 0) json["scan"] = scan_json(a.scan);
  return json;
}

void print_head() {
  fmt::print("{:<11} {:>5} {:>8} {:>8} {:>8} {:>10} {:>11} {:>5} {:>9} {:>9} {:>8} {:>7} {:>7}\n", "row",
             "seed", "20 m, %", "50 m, %", "100 m, %", "deg/100 m", "worst/mean", "lost", "lifespan",
             "scan med.", "p95", "false %", "miss %");
}

void print_line(const std::string& name, const std::string& seed, const nlohmann::json& r,
                double worst_to_mean) {
  const auto percent = [&](const char* length) {
    return r["segments"][length]["translation_mean_percent"].get<double>();
  };
  const auto scan = [&](const char* key) { return r.contains("scan") ? r["scan"][key].get<double>() : NAN; };
  fmt::print(
      "{:<11} {:>5} {:>8.3f} {:>8.3f} {:>8.3f} {:>10.3f} {:>11.2f} {:>5} {:>7.2f} s {:>7.3f} m {:>6.3f} m "
      "{:>7.2f} {:>7.2f}\n",
      name, seed, percent("20"), percent("50"), percent("100"),
      r["segments"]["100"]["rotation_mean_deg"].get<double>(), worst_to_mean, r["lost"].get<int>(),
      r["lifespan_mean_s"].get<double>(), scan("error_median_m"), scan("error_p95_m"),
      scan("false_obstacle_percent"), scan("miss_percent"));
  std::fflush(stdout);
}

nlohmann::json parked_json(const ParkedAccuracy& p) {
  return {{"parked_s", p.parked_s},       {"moved_m", p.moved_m},         {"turned_deg", p.turned_deg},
          {"later_m", p.later_m},         {"seen_before", p.seen_before}, {"seen_after", p.seen_after}};
}

void print_parked(int seed, const nlohmann::json& p) {
  fmt::print("parked      {:>5}  {:.0f} s; the estimate moved by {:.4f} m and {:.3f} deg at most; error 10 m later {:.3f} m; of what is within 8 m "
             "scan_360 shows {:.1f} % in the first minute, {:.1f} % in the last\n",
             seed, p["parked_s"].get<double>(), p["moved_m"].get<double>(), p["turned_deg"].get<double>(), p["later_m"].get<double>(),
             100.0 * p["seen_before"].get<double>(), 100.0 * p["seen_after"].get<double>());
  std::fflush(stdout);
}

/// The mean over runs of every number that print_line shows.
nlohmann::json mean_json(const nlohmann::json& runs, const ScanAccuracy& scan, double* worst_to_mean) {
  nlohmann::json mean;
  const double n = static_cast<double>(runs.size());
  double worst = 0.0;
  mean["lost"] = 0;
  for (const auto& r : runs) {
    mean["lost"] = mean["lost"].get<int>() + (r["lost"].get<bool>() ? 1 : 0);
    worst = std::max(worst, r["segments"]["20"]["translation_mean_percent"].get<double>());
    mean["lifespan_mean_s"] = mean.value("lifespan_mean_s", 0.0) + r["lifespan_mean_s"].get<double>() / n;
    for (const char* kind : {"segments", "odometry_segments"}) {
      for (const auto& [length, s] : r[kind].items()) {
        for (const char* key : {"translation_mean_m", "translation_mean_percent", "rotation_mean_deg"}) {
          auto& sum = mean[kind][length][key];
          sum = (sum.is_null() ? 0.0 : sum.get<double>()) + s[key].get<double>() / n;
        }
      }
    }
  }
  if (scan.rays > 0) mean["scan"] = scan_json(scan);
  *worst_to_mean = worst / mean["segments"]["20"]["translation_mean_percent"].get<double>();
  mean["worst_to_mean_20_m"] = *worst_to_mean;
  return mean;
}

void benchmark(const Options& options) {
  const auto mapper_config = read_config_section<LocalMapperConfig>(options.config, "local_mapper");
  SimulatedRecordings recordings(options.cache, options.fresh);
  const auto drive_of = [&](const Row& row, int seed) {
    SimulatedDrive drive;
    drive.world_file = options.worlds + "/" + row.world;
    drive.tour_file = options.worlds + "/" + row.tour;
    drive.sensor = row.sensor;
    drive.seed = seed;
    drive.front_end = FrontEndConfig::from_file(options.config);
    if (options.quick) drive.limit_s = 75.0;
    return drive;
  };
  const int seeds = options.quick ? 1 : options.seeds;
  int missing = 0;
  for (const std::string& name : options.rows) {
    for (int s = 0; s < seeds; ++s) {
      const Row row = row_named(name);
      if (!row.paper && !row.driven && !recordings.have(drive_of(row, options.first_seed + s))) ++missing;
    }
  }
  if (missing > 0) {
    fmt::print(stderr, "{} drives are not in {} yet; simulating them takes about {:.0f} min of one core.\n",
               missing, options.cache, missing * (options.quick ? 0.6 : 3.5));
  }
  nlohmann::json json;
  if (!options.record_only) print_head();
  for (const std::string& name : options.rows) {
    const Row row = row_named(name);
    LocalMapperConfig config =
        row.paper ? read_config_section<LocalMapperConfig>(options.paper_config, "local_mapper") : mapper_config;
    if (row.driven) config.range_errors.learn = true;
    nlohmann::json runs = nlohmann::json::array();
    ScanAccuracy scan;
    for (int s = 0; s < seeds; ++s) {
      const int seed = options.first_seed + s;
      const SimulatedDrive drive = drive_of(row, seed);
      if (options.record_only) {
        if (!recordings.have(drive)) recordings.get(drive);
        continue;
      }
      const ProfileRecording recording = recordings.get(drive);
      config.seed = options.mapper_seed >= 0 ? options.mapper_seed : seed;
      RangeOffsets known;
      if (row.driven) {
        const int before = options.first_seed + (s + 1) % std::max(2, seeds);
        known = measure_mapper(recordings.get(drive_of(row, before)), config, false).learned;
        stop_if_interrupted();
      }
      const MapperAccuracy accuracy =
          measure_mapper(recording, config, !options.no_scans, row.driven ? &known : nullptr);
      stop_if_interrupted();
      scan.add(accuracy.scan);
      if (!options.trajectories.empty()) {
        const std::string path = fmt::format("{}/{}-{}", options.trajectories, name, seed);
        write_trajectory(path + ".tum", accuracy.estimate);
        write_trajectory(path + ".odometry.tum", accuracy.odometry);
        write_trajectory(path + ".truth.tum", recording.truth);
      }
      nlohmann::json run = run_json(seed, accuracy);
      if (name == "parked") {
        run["parked"] = parked_json(parked_accuracy(accuracy.estimate, recording.truth, accuracy.shares));
        print_parked(seed, run["parked"]);
        runs.push_back(std::move(run));
        continue;
      }
      print_line(name, std::to_string(seed), run, NAN);
      runs.push_back(std::move(run));
    }
    if (runs.empty()) continue;
    json[name] = {{"world", row.world}, {"sensor", row.sensor}, {"seeds", seeds}, {"runs", runs}};
    if (name == "parked") continue;  // 24 m of way: no segments to take the mean of
    double worst_to_mean = 0.0;
    const nlohmann::json mean = mean_json(runs, scan, &worst_to_mean);
    print_line(name, "mean", mean, worst_to_mean);
    json[name]["mean"] = mean;
  }
  if (!options.record_only) write_json(options.json, json.dump(2));
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(knav::kHelp, "mapper_benchmark");
  knav::Options options;
  options.cache = knav::default_cache();
  app.add_option("--rows", options.rows, "Which rows, separated by commas")
      ->delimiter(',')
      ->check(CLI::IsMember({"ideal", "calibrated", "driven", "default", "harsh", "paper", "people", "parked"}))
      ->capture_default_str();
  app.add_option("--seeds", options.seeds, "Drives a row")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--first-seed", options.first_seed, "Seed of the first drive")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--mapper-seed", options.mapper_seed, "Seed of the mapper; otherwise that of the drive");
  app.add_option("--config", options.config, "Configuration file; its front end and 'local_mapper' are used")
      ->capture_default_str();
  app.add_option("--paper-config", options.paper_config, "The same of the row 'paper'; only 'local_mapper' is used")
      ->capture_default_str();
  app.add_option("--worlds", options.worlds,
                 "Folder of brin_building.yaml, brin_people.yaml, brin_tour.yaml and brin_parked_tour.yaml")
      ->capture_default_str();
  app.add_option("--cache", options.cache, "Folder of the simulated drives")->capture_default_str();
  app.add_option("--json", options.json, "Write all figures here ('-' for standard output)");
  app.add_option("--trajectories", options.trajectories,
                 "Write ROW-SEED.tum, .odometry.tum and .truth.tum into this existing folder");
  app.add_flag("--quick", options.quick, "One seed and the first 75 s of the drive; under 3 minutes");
  app.add_flag("--fresh", options.fresh,
               "Simulate again what is in the cache (after a change of the simulator)");
  app.add_flag("--record-only", options.record_only,
               "Fill the cache only; several such processes may share it");
  app.add_flag("--no-scans", options.no_scans, "Leave the virtual scan out");
  app.footer(knav::kJsonHelp);
  return knav::run_command(app, argc, argv, [&] { knav::benchmark(options); });
}
