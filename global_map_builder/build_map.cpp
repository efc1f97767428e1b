// build_map: a recording of a mapping drive as a map directory.
#include <fmt/format.h>
#include <sys/resource.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/progress.h"
#include "depth_profile_nodelet/front_end.h"
#include "global_map_builder/build_map_config.h"
#include "global_map_builder/closure_list.h"
#include "global_map_builder/map_builder.h"
#include "global_map_builder/map_writer.h"
#include "global_map_builder/ordered_worker.h"
#include "ros_common/command_line.h"

namespace knav {
namespace {

using Json = nlohmann::json;

const char* const kFooter =
    R"(Several bags: parts of one drive, in order, are put together; a bag that begins elsewhere or at another time is a
drive of its own and is found in the others, wherever it began.
DIR receives map.yaml, map.pgm (map_server's format), distance.tiff (float32 m, signed, NaN unknown), keepout.pgm,
places.yaml, trajectory.tum, graph.g2o, closures.json, closures.yaml (the allow / deny list), report.html, map.png,
drives.bin (what --extend needs), changes.json (with --extend) and metadata.yaml.
The JSON of --json holds source, observations (count), frames_used, drives, path_m, keyframes, marks, breaks (times the
mapper lost the thread), mended_steps (its jumps, mended), settled_keyframes (of a scanner, that stood turned wrongly), fitted_pairs (of keyframes whose views were fitted), closures {found, accepted, button, automatic, located,
list}, graph {chi2, edges}, map {width_m, height_m, contour_m, checksum}, changes (count), time_s {read, refinement,
closures, fitting, surface, distance, write, total}, recording_s, memory_mb, seed.
closures.json holds, for each, from_drive, to_drive, from_stamp_s, to_stamp_s, source, verdict (of the list), matched,
accepted, reason, x_m, y_m, yaw_rad (of the later pose in the earlier), score, overlap, agreement, residual_m, rival,
chi2. changes.json holds, for each area, now (occupied or free), x_m, y_m (its middle), width_m, height_m, wall_m.)";

struct Options {
  std::vector<std::string> bags;
  std::string out, config, from, json, list, extend, again;
  int seed = -1;
  bool force = false;
};

/// One bar a stage.
class Stages {
 public:
  void update(const char* stage, double fraction, const std::string& note = "") {
    stop_if_interrupted();
    if (!bar_ || stage_ != stage) {
      if (bar_) bar_->update(1.0);
      bar_.reset();
      bar_ = std::make_unique<Progress>(std::string("build_map: ") + stage);
      stage_ = stage;
    }
    bar_->update(fraction, note);
  }
  void finish() {
    if (bar_) bar_->update(1.0);
    bar_.reset();
  }

 private:
  std::string stage_;
  std::unique_ptr<Progress> bar_;
};

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double peak_memory_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

constexpr std::size_t kReadAhead = 64;  // odometry, observations and marks that wait for the mapper

struct Read {
  std::string source;
  std::size_t observations = 0, marks = 0;
  int drives = 0;
  double recording_s = 0.0;
};

/// Tells whether a bag goes on with the drive that the last one ended in, from clock and odometry.
class DriveEnd {
 public:
  void add(double stamp_s, const Pose2& T_odom_base) {
    stamp_s_ = stamp_s;
    T_odom_base_ = T_odom_base;
  }
  bool continued_by(double stamp_s, const Pose2& T_odom_base) const {
    constexpr double kPause_s = 30.0, kSpeed_mps = 1.5, kTurn_radps = 2.5, kSlack = 0.1;
    const double pause_s = stamp_s - stamp_s_;
    return pause_s >= 0.0 && pause_s < kPause_s &&
           distance_m(T_odom_base, T_odom_base_) < kSlack + kSpeed_mps * pause_s &&
           std::fabs(normalize_angle_rad(T_odom_base.yaw_rad - T_odom_base_.yaw_rad)) <
               kSlack + kTurn_radps * pause_s;
  }

 private:
  double stamp_s_ = 1e300;
  Pose2 T_odom_base_;
};

Read read_bags(const Options& options, const ObservationReaderConfig& config, const FrontEndConfig& front_end,
               MapBuilder* builder, Stages* stages) {
  Read read;
  DriveEnd end;
  for (std::size_t i = 0; i < options.bags.size(); ++i) {
    ObservationReader reader(options.bags[i], config, front_end);
    bool first = true;
    const auto add_odometry = [&](double stamp_s, const Pose2& T) {
      if (first && !end.continued_by(stamp_s, T)) {
        builder->begin_drive(options.bags[i]);
        ++read.drives;
      }
      first = false;
      end.add(stamp_s, T);
      builder->add_odometry(stamp_s, T);
    };
    const auto show_progress = [&](double fraction) {
      const Drive& drive = builder->drive();
      stages->update("trajectory",
                     (static_cast<double>(i) + fraction) / static_cast<double>(options.bags.size()),
                     fmt::format("{} frames, {:.0f} m", drive.trajectory.size(),
                                 drive.keyframes.empty() ? 0.0 : drive.keyframes.back().path_m));
    };
    OrderedWorker mapping(kReadAhead);  // ends before what it refers to
    ObservationCallbacks callbacks;
    callbacks.add_odometry = [&](double stamp_s, const Pose2& T) { mapping.run([&, stamp_s, T] { add_odometry(stamp_s, T); }); };
    callbacks.profile = [&](const DepthProfile& profile, const Pose2& T) { mapping.run([=] { builder->add(profile, T); }); };
    callbacks.scan = [&](const RangeScan& scan, const Pose2& T) { mapping.run([=] { builder->add(scan, T); }); };
    callbacks.mark = [&](double stamp_s) { mapping.run([=] { builder->mark(stamp_s); }); };
    callbacks.progress = [&](double fraction) { mapping.run([&, fraction] { show_progress(fraction); }); };
    reader.read(callbacks);
    mapping.finish();
    stages->finish();
    for (const std::string& warning : reader.warnings()) fmt::print(stderr, "build_map: {}\n", warning);
    const auto& statistics = reader.statistics();
    if (statistics.observations == 0) {
      throw UserError(fmt::format("{}: holds no usable observation; nothing was built.", options.bags[i]));
    }
    if (statistics.odometry == 0)
      throw UserError(options.bags[i] + ": its odometry holds no usable message.");
    read.recording_s += statistics.last_stamp_s - statistics.first_stamp_s;
    read.source = reader.source();
    read.observations += statistics.observations;
    read.marks += statistics.marks;
  }
  return read;
}

MapRecord load_record(const std::string& directory) {
  if (!is_map_directory(directory)) throw UserError(directory + ": is not a map directory.");
  const std::string file = directory + "/drives.bin";
  if (!std::filesystem::exists(file)) {
    throw UserError(directory +
                    ": has no drives.bin, so it can be neither extended nor built again; build it anew from "
                    "its recordings.");
  }
  return read_map_record(file);
}

/// The map to add to.
void load_old(const std::string& directory, const BuildMapConfig& config, MapBuilder* builder) {
  MapRecord record = load_record(directory);
  MapDirectory map = load_map(directory);
  for (const std::string& warning : map.warnings) fmt::print(stderr, "build_map: {}\n", warning);
  if (map.occupancy.geometry.resolution_m != config.surface.resolution_m) {
    throw UserError(
        fmt::format("{}: has cells of {} m, but map_builder/surface/resolution_m is {}; they must be equal.",
                    directory, map.occupancy.geometry.resolution_m, config.surface.resolution_m));
  }
  builder->extend(std::move(record), std::move(map));
}

void print_changes(const std::vector<MapChange>& changes) {
  constexpr std::size_t kShown = 10;
  fmt::print(stderr, "{} areas changed{}\n", changes.size(), changes.size() > kShown ? ", the largest:" : "");
  for (std::size_t i = 0; i < std::min(kShown, changes.size()); ++i) {
    const MapChange& c = changes[i];
    fmt::print(stderr, "  now {}: {:.1f} x {:.1f} m at ({:.2f}, {:.2f})\n", c.occupied ? "occupied" : "free",
               c.width_m, c.height_m, c.x_m, c.y_m);
  }
}

void build_map(const Options& options) {
  const auto start = std::chrono::steady_clock::now();
  auto config = read_config_section<BuildMapConfig>(options.config, "map_builder");
  auto mapper = read_config_section<LocalMapperConfig>(options.config, "local_mapper");
  if (options.seed >= 0) mapper.seed = options.seed;
  if (!options.from.empty()) config.recording.source = options.from;
  const FrontEndConfig front_end = FrontEndConfig::from_file(options.config);

  MapBuilder builder(config, mapper);
  const std::string old = options.extend.empty() ? options.again : options.extend;
  const std::string out = options.out.empty() ? old : options.out;
  if (out.empty()) {
    throw UserError(
        "--out is required; only --extend and --again can do without, and then replace the old map.");
  }
  if (!options.list.empty()) builder.set_list(read_closure_list(options.list));
  if (!options.extend.empty()) load_old(options.extend, config, &builder);
  Stages stages;
  Read read;
  if (!options.again.empty()) {
    if (!options.bags.empty() || !options.extend.empty()) {
      throw UserError("--again takes its drives from the map; give neither BAG nor --extend with it.");
    }
    builder.build_again(load_record(options.again));
    read.source = "drives.bin of " + options.again;
  } else {
    if (options.bags.empty()) throw UserError("no BAG was given; see --help.");
    read = read_bags(options, config.recording, front_end, &builder, &stages);
  }
  const double read_s = seconds_since(start);
  BuiltMap built = builder.build([&](const char* stage, double fraction) { stages.update(stage, fraction); });
  stages.finish();

  Json json = figures_of(built);
  json["source"] = read.source;
  json["observations"] = read.observations;
  json["marks"] = read.marks;
  json["recording_s"] = read.recording_s;
  json["seed"] = mapper.seed;
  built.map.about["made_by"] = "build_map";
  const auto write_start = std::chrono::steady_clock::now();
  stages.update("writing", 0.0);
  // An extended map carries keepout and places over, so that nothing drawn by hand is lost.
  const bool in_place = !options.extend.empty() && std::filesystem::exists(out) &&
                        std::filesystem::equivalent(options.extend, out);
  write_built_map(out, json, options.force || in_place, &built);
  stages.finish();

  const double total_s = seconds_since(start);
  json["map"]["checksum"] = built.map.checksum;
  json["time_s"] = {{"read", read_s},
                    {"refinement", built.stage_s["refinement"]},
                    {"closures", built.stage_s["closures"]},
                    {"fitting", built.stage_s["fitting"]},
                    {"surface", built.stage_s["surface"]},
                    {"distance", built.stage_s["distance"]},
                    {"write", seconds_since(write_start)},
                    {"total", total_s}};
  json["memory_mb"] = peak_memory_mb();
  write_json(options.json, json.dump(2));
  const int breaks = json["breaks"];
  if (breaks > 0) {
    fmt::print(stderr,
               "build_map: the local mapper lost the thread {} times; the map hangs on odometry there.\n",
               breaks);
  }
  if (built.old_drives > 0) print_changes(built.changes);
  fmt::print(stderr,
             "{}: {:.1f} x {:.1f} m, {:.0f} m driven, {} of {} closures, {:.0f} s of recording in {:.1f} s\n",
             out, json["map"]["width_m"].get<double>(), json["map"]["height_m"].get<double>(),
             json["path_m"].get<double>(), json["closures"]["accepted"].get<int>(),
             json["closures"]["found"].get<int>(), read.recording_s, total_s);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(
      "Builds a map directory from a recorded drive: depth profiles, a LaserScan or depth images, with "
      "odometry,\n"
      "TF and button marks. The same bag, configuration and seed give the same map.");
  knav::Options options;
  app.add_option("BAG", options.bags,
                 "recording; several: parts of a drive, or several drives of one building");
  app.add_option("--out", options.out, "map directory to write; an older map there is replaced as a whole");
  app.add_option("--extend", options.extend,
                 "map directory to add the drives to, in its frame; replaced if there is no --out");
  app.add_option(
      "--again", options.again,
      "map directory to build again from what it keeps of its drives, without its recordings: with another\n"
      "list of closures or another configuration of map_builder");
  app.add_option(
      "--closures", options.list,
      "allow / deny list: an edited closures.yaml, as lies in a map directory or report.html saves");
  app.add_option("--config", options.config,
                 "configuration file, as config/default.yaml (sections map_builder, local_mapper)");
  app.add_option("--from", options.from, "what to build from; auto takes what the bag has")
      ->check(CLI::IsMember({"auto", "depth", "profile", "scan"}));
  app.add_option("--seed", options.seed, "overrides local_mapper/seed")->check(CLI::NonNegativeNumber);
  app.add_option("--json", options.json, "write the figures to this file; '-' for standard output");
  app.add_flag("--force", options.force,
               "replace a map even if its keepout.pgm or places.yaml were edited by hand");
  app.footer(knav::kFooter);
  return knav::run_command(app, argc, argv, [&] { knav::build_map(options); });
}
