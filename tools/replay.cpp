// replay: a recording through the front end and the local mapper, without a master, as fast as the CPU allows.
#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/progress.h"
#include "core/trajectory.h"
#include "depth_profile_nodelet/front_end.h"
#include "global_map_builder/observation_reader.h"
#include "ros_common/command_line.h"
#include "tools/local_map_picture.h"
#include "tools/mapper_trajectory.h"
#include "tsdf_local_mapper/local_mapper.h"

namespace knav {
namespace {

struct Options {
  std::string bag, range_errors, trajectory, config, map_out, json, profiles;
  std::string from = "auto";
  int seed = -1;
  bool odometry_only = false;
};

const char* const kJsonHelp =
    R"(The JSON holds source, frames, frames_accepted, frames_rejected (counts), recording_s, elapsed_s,
speed_ratio (recording_s / elapsed_s), epochs (count), path_m (length of the estimate), seed.)";


void replay(const Options& options) {
  auto mapper_config = read_config_section<LocalMapperConfig>(options.config, "local_mapper");
  if (options.seed >= 0) mapper_config.seed = options.seed;
  ObservationReaderConfig reader_config;
  reader_config.source = options.from;
  ObservationReader reader(options.bag, reader_config, FrontEndConfig::from_file(options.config));
  if (!options.range_errors.empty() && !mapper_config.range_errors.learn) {
    throw UserError("--range-errors needs local_mapper/range_errors/learn: true in the configuration (--config).");
  }
  LocalMapper mapper(mapper_config);
  if (!options.range_errors.empty() && std::filesystem::exists(options.range_errors)) {
    mapper.start_from(RangeOffsets::load(options.range_errors));
  }
  MapperTrajectory recorder;
  Progress progress("replay (" + reader.source() + ")");

  ObservationCallbacks callbacks;
  callbacks.add_odometry = [&](double stamp_s, const Pose2& T) { mapper.add_odometry(stamp_s, T); };
  std::string profiles_csv;
  callbacks.profile = [&](const DepthProfile& profile, const Pose2& T) {
    if (!options.profiles.empty()) {
      profiles_csv += fmt::format("{:.6f},{:.4f}\n", profile.stamp_s, fmt::join(profile.z_m, ","));
    }
    recorder.add(mapper.update(profile, T));
  };
  callbacks.scan = [&](const RangeScan& scan, const Pose2& T) { recorder.add(mapper.update(scan, T)); };
  callbacks.progress = [&](double fraction) {
    progress.update(fraction, fmt::format("{} frames, {:.1f} m", recorder.frames(), recorder.path_m()));
  };
  const auto start = std::chrono::steady_clock::now();
  reader.read(callbacks);
  const double elapsed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  progress.update(1.0);
  for (const std::string& warning : reader.warnings()) fmt::print(stderr, "replay: {}\n", warning);
  if (recorder.estimate().empty()) {
    throw UserError(options.bag + ": no frame could be used: " + mapper.result().reason);
  }

  write_trajectory(options.trajectory, options.odometry_only ? recorder.odometry() : recorder.estimate());
  if (!options.profiles.empty()) write_text_atomically(options.profiles, profiles_csv);
  if (!options.range_errors.empty()) mapper.range_offsets().save(options.range_errors);
  if (!options.map_out.empty()) write_local_map_pictures(options.map_out, mapper);
  const double recording_s = reader.statistics().last_stamp_s - reader.statistics().first_stamp_s;
  const nlohmann::json json = {{"source", reader.source()},
                               {"frames", recorder.frames()},
                               {"frames_accepted", recorder.accepted()},
                               {"frames_rejected", reader.statistics().rejected},
                               {"recording_s", recording_s},
                               {"elapsed_s", elapsed_s},
                               {"speed_ratio", elapsed_s > 0.0 ? recording_s / elapsed_s : 0.0},
                               {"epochs", recorder.epochs()},
                               {"path_m", recorder.path_m()},
                               {"seed", mapper_config.seed}};
  write_json(options.json, json.dump(2));
  fmt::print(stderr, "{}: {} of {} frames, {:.1f} m, {} epoch{}, {:.0f} s of recording in {:.1f} s\n",
             options.trajectory, recorder.accepted(), recorder.frames(), recorder.path_m(), recorder.epochs(),
             recorder.epochs() == 1 ? "" : "s", recording_s, elapsed_s);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(
      "Runs a recording through the front end (if it has depth images and no profiles) and the local mapper, and\n"
      "writes the robot's trajectory. The same bag, configuration and seed give the same bytes.");
  knav::Options options;
  app.add_option("BAG", options.bag, "recording with odometry and depth_profile, depth images or a LaserScan")->required();
  app.add_option("--trajectory", options.trajectory, "TUM text to write: t x y z qx qy qz qw")->required();
  app.add_option("--config", options.config, "configuration file, as config/default.yaml");
  app.add_option("--seed", options.seed, "overrides local_mapper/seed")->check(CLI::NonNegativeNumber);
  app.add_option("--from", options.from, "what to start from")
      ->check(CLI::IsMember({"auto", "profile", "scan", "depth"}))
      ->capture_default_str();
  app.add_option("--map-out", options.map_out, "folder for local_map.png, tsdf.png and scan_360.png of the end");
  app.add_option("--profiles", options.profiles, "write every depth profile as CSV: stamp [s], then z [m] per column");
  app.add_option("--range-errors", options.range_errors,
                 "what is learned of the depth camera's errors: read from this file if there is one, and written to it at the end");
  app.add_option("--json", options.json, "write the figures to this file; '-' for standard output");
  app.add_flag("--odometry", options.odometry_only, "write the odometry at the same stamps instead, to compare");
  app.footer(knav::kJsonHelp);
  return knav::run_command(app, argc, argv, [&] { knav::replay(options); });
}
