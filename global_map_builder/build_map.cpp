// build_map: a recording of a mapping drive as a map directory.
#include <fmt/format.h>
#include <sys/resource.h>

#include <chrono>
#include <nlohmann/json.hpp>

#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/progress.h"
#include "depth_profile_nodelet/front_end.h"
#include "global_map_builder/build_map_config.h"
#include "global_map_builder/map_builder.h"
#include "global_map_builder/map_picture.h"
#include "ros_common/command_line.h"

namespace knav {
namespace {

using Json = nlohmann::json;

const char* const kFooter =
    R"(DIR receives map.yaml, map.pgm (map_server's format), distance.tiff (float32 m, signed, NaN unknown), keepout.pgm,
places.yaml, trajectory.tum, graph.g2o, closures.json, map.png and metadata.yaml.
The JSON of --json holds source, observations (count), frames_used, path_m, keyframes, marks, breaks (times the mapper
lost the thread), mended_steps (its jumps, mended), closures {found, accepted, button, automatic}, graph {chi2, iterations}, map {width_m, height_m,
contour_m, checksum}, time_s {read, refinement, closures, surface, distance, total}, recording_s, memory_mb, seed.
closures.json holds, for each, from_stamp_s, to_stamp_s, source, matched, accepted, reason, x_m, y_m, yaw_rad (of the
later pose in the earlier), score, overlap, agreement, residual_m, rival, chi2.)";

struct Options {
  std::vector<std::string> bags;
  std::string out, config, from, json;
  int seed = -1;
  bool force = false;
};

/// One bar a stage.
class Stages {
 public:
  void update(const char* stage, double fraction, const std::string& note = "") {
    stop_if_interrupted();
    if (stage_ != stage) {
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

Json closures_json(const BuiltMap& built, const DriveRecorder& drive) {
  Json list = Json::array();
  for (const Closure& c : built.closures) {
    list.push_back({{"from_stamp_s", drive.keyframes()[static_cast<std::size_t>(c.from)].stamp_s},
                    {"to_stamp_s", drive.keyframes()[static_cast<std::size_t>(c.to)].stamp_s},
                    {"from", c.from},
                    {"to", c.to},
                    {"source", c.source},
                    {"matched", c.matched},
                    {"accepted", c.accepted},
                    {"reason", c.reason},
                    {"x_m", c.match.T_from_to.x_m},
                    {"y_m", c.match.T_from_to.y_m},
                    {"yaw_rad", c.match.T_from_to.yaw_rad},
                    {"score", c.match.score},
                    {"overlap", c.match.overlap},
                    {"agreement", c.match.agreement},
                    {"residual_m", c.match.residual_m},
                    {"rival", c.match.rival},
                    {"chi2", c.chi2}});
  }
  return list;
}

struct Read {
  std::string source;
  std::size_t observations = 0, marks = 0;
  double first_s = 0.0, last_s = 0.0;
};

Read read_bags(const Options& options, const ObservationReaderConfig& config, const FrontEndConfig& front_end,
               MapBuilder* builder, Stages* stages) {
  Read read;
  for (std::size_t i = 0; i < options.bags.size(); ++i) {
    ObservationReader reader(options.bags[i], config, front_end);
    ObservationCallbacks callbacks;
    callbacks.add_odometry = [&](double stamp_s, const Pose2& T) { builder->add_odometry(stamp_s, T); };
    callbacks.profile = [&](const DepthProfile& profile, const Pose2& T) { builder->add(profile, T); };
    callbacks.scan = [&](const RangeScan& scan, const Pose2& T) { builder->add(scan, T); };
    callbacks.mark = [&](double stamp_s) { builder->mark(stamp_s); };
    callbacks.progress = [&](double fraction) {
      const auto& poses = builder->drive().keyframes();
      stages->update("trajectory",
                     (static_cast<double>(i) + fraction) / static_cast<double>(options.bags.size()),
                     fmt::format("{} frames, {:.0f} m", builder->drive().trajectory().size(),
                                 poses.empty() ? 0.0 : poses.back().path_m));
    };
    reader.read(callbacks);
    stages->finish();
    for (const std::string& warning : reader.warnings()) fmt::print(stderr, "build_map: {}\n", warning);
    const auto& statistics = reader.statistics();
    if (statistics.observations == 0) {
      throw UserError(fmt::format("{}: holds no usable observation; nothing was built.", options.bags[i]));
    }
    if (statistics.odometry == 0)
      throw UserError(options.bags[i] + ": its odometry holds no usable message.");
    if (read.observations > 0 && statistics.first_stamp_s < read.last_s) {
      throw UserError(
          fmt::format("{}: begins before {} ends; several bags must be parts of one drive, in order.",
                      options.bags[i], options.bags[i - 1]));
    }
    if (read.observations == 0) read.first_s = statistics.first_stamp_s;
    read.last_s = statistics.last_stamp_s;
    read.source = reader.source();
    read.observations += statistics.observations;
    read.marks += statistics.marks;
  }
  return read;
}

void build_map(const Options& options) {
  const auto start = std::chrono::steady_clock::now();
  auto config = read_config_section<BuildMapConfig>(options.config, "map_builder");
  auto mapper = read_config_section<LocalMapperConfig>(options.config, "local_mapper");
  if (options.seed >= 0) mapper.seed = options.seed;
  if (!options.from.empty()) config.recording.source = options.from;
  const FrontEndConfig front_end = FrontEndConfig::from_file(options.config);

  MapBuilder builder(config, mapper);
  Stages stages;
  const Read read = read_bags(options, config.recording, front_end, &builder, &stages);
  const double read_s = seconds_since(start);
  BuiltMap built;
  try {
    built = builder.build([&](const char* stage, double fraction) { stages.update(stage, fraction); });
  } catch (const UserError& error) {
    throw UserError(options.bags.front() + ": " + error.what());
  }
  stages.finish();

  const DriveRecorder& drive = builder.drive();
  std::size_t accepted = 0, by_button = 0;
  for (const Closure& c : built.closures) {
    accepted += c.accepted;
    by_button += c.accepted && c.source == "button";
  }
  double contour_m = 0.0;
  for (const ContourSegment& s : built.contour) contour_m += std::hypot(s.a.x_m - s.b.x_m, s.a.y_m - s.b.y_m);

  built.map.about = {{"made_by", "build_map"},
                     {"bags", fmt::format("{}", fmt::join(options.bags, ", "))},
                     {"source", read.source},
                     {"seed", std::to_string(mapper.seed)},
                     {"path_m", fmt::format("{:.1f}", drive.keyframes().back().path_m)},
                     {"closures_accepted", std::to_string(accepted)}};
  built.map.checksum = save_map(options.out, built.map, options.force, [&](const std::string& folder) {
    write_pose_graph(folder + "/graph.g2o", built.graph);
    write_text_atomically(folder + "/closures.json", closures_json(built, drive).dump(1) + "\n");
    write_map_picture(folder + "/map.png", built);
  });

  const GridGeometry& g = built.map.occupancy.geometry;
  const double total_s = seconds_since(start);
  const Json json = {{"source", read.source},
                     {"observations", read.observations},
                     {"frames_used", drive.frames().size()},
                     {"path_m", drive.keyframes().back().path_m},
                     {"keyframes", drive.keyframes().size()},
                     {"marks", read.marks},
                     {"breaks", drive.breaks()},
                     {"mended_steps", built.mended_steps},
                     {"closures",
                      {{"found", built.closures.size()},
                       {"accepted", accepted},
                       {"button", by_button},
                       {"automatic", accepted - by_button}}},
                     {"graph", {{"chi2", chi2(built.graph)}, {"edges", built.graph.edges.size()}}},
                     {"map",
                      {{"width_m", g.width_cells * g.resolution_m},
                       {"height_m", g.height_cells * g.resolution_m},
                       {"contour_m", contour_m},
                       {"checksum", built.map.checksum}}},
                     {"time_s",
                      {{"read", read_s},
                       {"refinement", built.stage_s["refinement"]},
                       {"closures", built.stage_s["closures"]},
                       {"surface", built.stage_s["surface"]},
                       {"distance", built.stage_s["distance"]},
                       {"total", total_s}}},
                     {"recording_s", read.last_s - read.first_s},
                     {"memory_mb", peak_memory_mb()},
                     {"seed", mapper.seed}};
  write_json(options.json, json.dump(2));
  if (drive.breaks() > 0) {
    fmt::print(stderr,
               "build_map: the local mapper lost the thread {} times; the map hangs on odometry there.\n",
               drive.breaks());
  }
  fmt::print(stderr,
             "{}: {:.1f} x {:.1f} m, {:.0f} m driven, {} of {} closures, {:.0f} s of recording in {:.1f} s\n",
             options.out, g.width_cells * g.resolution_m, g.height_cells * g.resolution_m,
             drive.keyframes().back().path_m, accepted, built.closures.size(), read.last_s - read.first_s,
             total_s);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(
      "Builds a map directory from a recorded drive: depth profiles, a LaserScan or depth images, with "
      "odometry,\n"
      "TF and button marks. The same bag, configuration and seed give the same map.");
  knav::Options options;
  app.add_option("BAG", options.bags, "recording; several are the parts of one drive, in order")->required();
  app.add_option("--out", options.out, "map directory to write; an older map there is replaced as a whole")
      ->required();
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
