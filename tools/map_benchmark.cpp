// map_benchmark: how accurate the global map is on simulated drives whose truth is known.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"
#include "global_map_builder/map_builder.h"
#include "global_map_builder/map_writer.h"
#include "kinect_sim/map_evaluation.h"
#include "kinect_sim/world.h"
#include "ros_common/command_line.h"
#include "tools/simulated_recordings.h"
#include "tools/trajectory_metrics.h"

namespace knav {
namespace {

constexpr char kHelp[] =
    "Simulates mapping drives (once; kept in --cache, which it shares with mapper_benchmark), builds their "
    "maps from\n"
    "profiles and compares them with the building. Rows of the table:\n"
    "  truth      the true trajectory: what sensor and surface alone cost\n"
    "  none       no closures\n"
    "  button     closures by the button only\n"
    "  automatic  by matching only\n"
    "  both       the default\n"
    "  falsified  both, 5 % of the closures found moved by metres on purpose; drawn anew until it is one at least";
constexpr char kJsonHelp[] =
    R"(The JSON holds, per seed and row: ate_m (root mean square, after rigid alignment), ate_before_m (of the local
mapper alone), map_rmse_m, map_median_m, map_percentile_95_m, map_completeness (as evaluate_map), closures_found,
closures_accepted, closures_falsified, worst_closure_m and worst_closure_deg (of the accepted ones, against the truth), build_s.)";

struct Options {
  std::string world = "config/worlds/brin_building.yaml", tour = "config/worlds/brin_tour.yaml";
  std::string cache, config, json, out, sensor = "calibrated";
  std::vector<std::string> rows = {"button", "automatic", "both", "falsified"};
  int seeds = 3, first_seed = 1;
};

/// From the mapper only: what every row starts from.
MapRecord record_of(const ProfileRecording& recording, const std::vector<double>& marks,
                    const MapBuilderConfig& config, const LocalMapperConfig& mapper) {
  DriveRecorder recorder(config.drive, mapper);
  DepthProfile profile;
  std::size_t next_odometry = 0, next_mark = 0;
  for (std::size_t i = 0; i < recording.frames(); ++i) {
    recording.profile(i, &profile);
    for (; next_odometry < recording.odometry.size() &&
           recording.odometry[next_odometry].stamp_s <= profile.stamp_s + 1.0 / 60.0;
         ++next_odometry) {
      recorder.add_odometry(recording.odometry[next_odometry].stamp_s,
                            recording.odometry[next_odometry].T_map_robot);
    }
    for (; next_mark < marks.size() && marks[next_mark] <= profile.stamp_s; ++next_mark) {
      recorder.mark(marks[next_mark]);
    }
    recorder.add(profile, recording.T_base_camera);
    if (i % 64 == 0) stop_if_interrupted();
  }
  MapRecord record;
  record.drives.push_back(recorder.take_drive());
  for (const Keyframe& keyframe : record.drives[0].keyframes) record.T_map_keyframe.push_back(keyframe.T_drive_base);
  return record;
}

/// The same drive on the true poses.
MapRecord on_the_truth(MapRecord record, const Trajectory& truth) {
  Drive& drive = record.drives[0];
  const auto true_pose = [&](double stamp_s, Pose2* pose) {
    Pose2 T_world_base;
    if (interpolate_at(truth, stamp_s, 1.0, &T_world_base)) {
      *pose = truth.front().T_map_robot.inverse() * T_world_base;
    }
  };
  for (DriveFrame& frame : drive.frames) true_pose(frame.stamp_s, &frame.T_drive_base);
  for (Keyframe& keyframe : drive.keyframes) true_pose(keyframe.stamp_s, &keyframe.T_drive_base);
  for (StampedPose2& pose : drive.trajectory) true_pose(pose.stamp_s, &pose.T_map_robot);
  for (PoseGraphEdge& edge : drive.edges) {
    edge.T_from_to = drive.keyframes[static_cast<std::size_t>(edge.from)].T_drive_base.inverse() *
                     drive.keyframes[static_cast<std::size_t>(edge.to)].T_drive_base;
  }
  return record;
}

constexpr int kDraws = 50;  // of what is falsified: 5 % of few closures is often none

int falsified(const BuiltMap& built) {
  return static_cast<int>(std::count_if(built.record.closures.begin(), built.record.closures.end(),
                                        [](const Closure& c) { return c.source == "falsified"; }));
}

MapBuilderConfig config_of(const std::string& row, MapBuilderConfig config) {
  config.closures.automatic = row == "automatic" || row == "both" || row == "falsified";
  config.closures.buttons = row == "button" || row == "both" || row == "falsified";
  if (row == "falsified") config.closures.falsify_share = 0.05;
  return config;
}

struct ClosureErrors {
  double worst_m = 0.0, worst_deg = 0.0;
};
ClosureErrors closure_errors(const MapRecord& record, const Trajectory& truth) {
  ClosureErrors errors;
  for (const Closure& closure : record.closures) {
    Pose2 from, to;
    if (!closure.accepted || !interpolate_at(truth, record.keyframe(closure.from).stamp_s, 1.0, &from) ||
        !interpolate_at(truth, record.keyframe(closure.to).stamp_s, 1.0, &to)) {
      continue;
    }
    const Pose2 error = (from.inverse() * to).inverse() * closure.match.T_from_to;
    errors.worst_m = std::max(errors.worst_m, std::hypot(error.x_m, error.y_m));
    errors.worst_deg = std::max(errors.worst_deg, std::fabs(error.yaw_rad) * 180.0 / kPi);
  }
  return errors;
}

void benchmark(const Options& options) {
  const auto config = read_config_section<MapBuilderConfig>(options.config, "map_builder");
  const auto mapper_config = read_config_section<LocalMapperConfig>(options.config, "local_mapper");
  SimulatedRecordings recordings(options.cache, false);
  const WorldConfig world = load_world(options.world);
  nlohmann::json json = nlohmann::json::array();
  fmt::print("{:<10} {:>4} {:>8} {:>8} {:>8} {:>8} {:>8} {:>9} {:>9} {:>8} {:>8} {:>8}\n", "row", "seed", "before",
             "ATE", "rmse", "median", "95 %", "complete", "closures", "worst", "deg", "build");
  for (int seed = options.first_seed; seed < options.first_seed + options.seeds; ++seed) {
    SimulatedDrive drive;
    drive.world_file = options.world;
    drive.tour_file = options.tour;
    drive.sensor = options.sensor;
    drive.seed = seed;
    drive.front_end = FrontEndConfig::from_file(options.config);
    const ProfileRecording recording = recordings.get(drive);
    LocalMapperConfig mapper = mapper_config;
    mapper.seed = seed;
    const std::string kept =
        options.out.empty() ? "" : fmt::format("{}/{}.drives.bin", options.out, seed);
    MapRecord record;
    if (!kept.empty() && std::filesystem::exists(kept)) {
      record = read_map_record(kept);
    } else {
      record = record_of(recording, SimulatedRecordings::marks_of(drive), config, mapper);
      if (!kept.empty()) write_map_record(kept, record);
    }
    int matched = 0;
    const double before_m =
        absolute_trajectory_error_m(record.drives[0].trajectory, recording.truth, &matched);
    for (const std::string& row : options.rows) {
      MapBuilderConfig row_config = config_of(row, config);
      BuiltMap built;
      double build_s = 0.0;
      for (int draw = 0; draw < kDraws; ++draw, ++row_config.closures.falsify_seed) {
        const auto start = std::chrono::steady_clock::now();
        MapBuilder builder(row_config, mapper);
        builder.build_again(row == "truth" ? on_the_truth(record, recording.truth) : record);
        built = builder.build([](const char*, double) { stop_if_interrupted(); });
        build_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        if (row != "falsified" || falsified(built) > 0) break;
      }
      if (row == "falsified" && falsified(built) == 0) {
        fmt::print(stderr, "map_benchmark: seed {}: {} draws falsified no closure; the row shows nothing.\n", seed, kDraws);
      }
      const double ate_m = absolute_trajectory_error_m(built.map.trajectory, recording.truth, &matched);
      const MapEvaluation e = evaluate_map(built.map.distance, world, recording.truth, {});
      const ClosureErrors errors = closure_errors(built.record, recording.truth);
      const auto found = built.record.closures.size();
      const auto accepted = std::count_if(built.record.closures.begin(), built.record.closures.end(),
                                          [](const Closure& c) { return c.accepted; });
      fmt::print(
          "{:<10} {:>4} {:>6.3f} m {:>6.3f} m {:>6.3f} m {:>6.3f} m {:>6.3f} m {:>9.3f} {:>4} / {:>2} {:>6.3f} "
          "m {:>8.2f} {:>6.1f} s\n",
          row, seed, before_m, ate_m, e.rmse_m, e.median_m, e.percentile_95_m, e.completeness, accepted, found,
          errors.worst_m, errors.worst_deg, build_s);
      std::fflush(stdout);
      json.push_back({{"row", row},
                      {"seed", seed},
                      {"ate_before_m", before_m},
                      {"ate_m", ate_m},
                      {"map_rmse_m", e.rmse_m},
                      {"map_median_m", e.median_m},
                      {"map_percentile_95_m", e.percentile_95_m},
                      {"map_completeness", e.completeness},
                      {"closures_found", found},
                      {"closures_accepted", accepted},
                      {"closures_falsified", falsified(built)},
                      {"worst_closure_m", errors.worst_m},
                      {"worst_closure_deg", errors.worst_deg},
                      {"build_s", build_s}});
      if (options.out.empty()) continue;
      const std::string name = fmt::format("{}/{}-{}", options.out, row, seed);
      std::vector<unsigned char> bytes;
      cv::imencode(".png", evaluation_picture(e, world, recording.truth, {}), bytes);
      write_text_atomically(name + ".png", std::string(bytes.begin(), bytes.end()));
      write_built_map(name, figures_of(built), true, &built);
      write_trajectory(name + "/truth.tum", recording.truth);
    }
  }
  write_json(options.json, json.dump(2));
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(knav::kHelp, "map_benchmark");
  knav::Options options;
  options.cache = knav::default_cache();
  app.add_option("--rows", options.rows, "Which rows, separated by commas")
      ->delimiter(',')
      ->check(CLI::IsMember({"truth", "none", "button", "automatic", "both", "falsified"}))
      ->capture_default_str();
  app.add_option("--world", options.world, "The building")->capture_default_str();
  app.add_option("--tour", options.tour, "The mapping drive")->capture_default_str();
  app.add_option("--sensor", options.sensor, "The simulated sensor")
      ->check(CLI::IsMember({"ideal", "calibrated", "default", "harsh"}))
      ->capture_default_str();
  app.add_option("--seeds", options.seeds, "Drives")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--first-seed", options.first_seed, "Seed of the first drive (simulator and mapper)")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--config", options.config,
                 "Configuration file; its front end, 'local_mapper' and 'map_builder' are used");
  app.add_option("--cache", options.cache, "Folder of the simulated drives")->capture_default_str();
  app.add_option("--json", options.json, "Write all figures here ('-' for standard output)");
  app.add_option("--out", options.out,
                 "Write maps and pictures into this existing folder; the local mapper's drives are kept there "
                 "too, and\nused again by the next run");
  app.footer(knav::kJsonHelp);
  return knav::run_command(app, argc, argv, [&] { knav::benchmark(options); });
}
