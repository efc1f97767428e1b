// localize: where the robot was during a recording, on a map, without a master.
#include <fmt/format.h>

#include <array>
#include <chrono>
#include <nlohmann/json.hpp>

#include "core/config.h"
#include "core/error.h"
#include "core/pose_buffer.h"
#include "core/progress.h"
#include "core/trajectory.h"
#include "depth_profile_nodelet/front_end.h"
#include "global_map_builder/map_directory.h"
#include "global_map_builder/observation_reader.h"
#include "ros_common/command_line.h"
#include "tsdf_local_mapper/local_mapper.h"
#include "tsdf_localizer/localizer.h"
#include "tsdf_localizer/localizer_node_config.h"

namespace knav {
namespace {

struct Options {
  std::string bag, map, trajectory, config, json;
  std::string from = "auto";
  std::vector<double> initial_pose;
  int seed = -1;
  bool raw_scan = false, only_ok = false;
};

const char* const kJsonHelp =
    R"(The JSON holds source, frames (count), poses_written (count), recording_s, elapsed_s, speed_ratio
(recording_s / elapsed_s), first_ok_s (since the first frame; null: never), verdict_fractions (of the scans, by
verdict: ok, uncertain, lost, initializing), inlier_fraction_mean, position_sd_mean_m (both over the scans that were
ok), update_mean_ms, update_max_ms (of the localizer alone), map_checksum, seed.)";

/// Feeds the localizer and gathers what it says.
class Follower {
 public:
  Follower(const LocalizerConfig& config, const LocalMapperConfig& mapper, bool raw_scan, bool only_ok)
      : localizer(config), mapper_(mapper), raw_scan_(raw_scan), only_ok_(only_ok) {}

  void add_odometry(double stamp_s, const Pose2& T_odom_base) {
    mapper_.add_odometry(stamp_s, T_odom_base);
    odometry_.add(stamp_s, T_odom_base);
  }

  void add(const DepthProfile& profile, const Pose2& T_base_camera) {
    from_mapper(mapper_.update(profile, T_base_camera));
  }
  void add(const RangeScan& scan, const Pose2& T_base_sensor) {
    if (!raw_scan_) return from_mapper(mapper_.update(scan, T_base_sensor));
    Pose2 T_odom_base;
    if (odometry_.at(scan.stamp_s, 1.0, 0.1, &T_odom_base) != PoseBuffer::Lookup::kOk) return;
    localize(scan, T_base_sensor, T_odom_base, 0, T_odom_base);
  }

  nlohmann::json figures() const {
    const double scans = std::max(1, scans_), ok = std::max(1, verdicts_[0]);
    nlohmann::json json;
    json["frames"] = scans_;
    json["poses_written"] = trajectory.size();
    json["first_ok_s"] = first_ok_s_ < 0.0 ? nlohmann::json() : nlohmann::json(first_ok_s_);
    for (std::size_t v = 0; v < verdicts_.size(); ++v) {
      json["verdict_fractions"][verdict_name(static_cast<LocalizationVerdict>(v))] = verdicts_[v] / scans;
    }
    json["inlier_fraction_mean"] = inlier_sum_ / ok;
    json["position_sd_mean_m"] = sd_sum_m_ / ok;
    json["update_mean_ms"] = update_sum_ms_ / scans;
    json["update_max_ms"] = update_max_ms_;
    return json;
  }
  int scans() const { return scans_; }

  Localizer localizer;
  Trajectory trajectory;

 private:
  void from_mapper(const LocalMapperResult& local) {
    if (!local.accepted) return;
    mapper_.extract_scan_360(&scan_);
    scan_.stamp_s = local.stamp_s;
    localize(scan_, Pose2(), local.T_local_base, local.epoch, local.T_odom_base);
  }

  void localize(const RangeScan& scan, const Pose2& T_base_sensor, const Pose2& T_local_base,
                std::uint32_t epoch, const Pose2& T_odom_base) {
    const auto begin = std::chrono::steady_clock::now();
    const LocalizerResult& r = localizer.update(scan, T_base_sensor, T_local_base, epoch, &T_odom_base);
    const double ms =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    mapper_.set_in_doubt(r.verdict != LocalizationVerdict::kOk);
    if (!r.accepted) return;
    if (scans_ == 0) first_s_ = r.stamp_s;
    ++scans_;
    update_sum_ms_ += ms;
    update_max_ms_ = std::max(update_max_ms_, ms);
    ++verdicts_[static_cast<std::size_t>(r.verdict)];
    const bool ok = r.verdict == LocalizationVerdict::kOk;
    if (ok && first_ok_s_ < 0.0) first_ok_s_ = r.stamp_s - first_s_;
    if (ok) {
      inlier_sum_ += r.inlier_fraction;
      sd_sum_m_ += r.position_sd_m;
    }
    if (r.has_pose && (ok || !only_ok_) && (trajectory.empty() || r.stamp_s > trajectory.back().stamp_s)) {
      trajectory.push_back({r.stamp_s, r.T_map_base});
    }
  }

  LocalMapper mapper_;
  bool raw_scan_, only_ok_;
  PoseBuffer odometry_;
  RangeScan scan_;
  int scans_ = 0;
  std::array<int, 4> verdicts_{};
  double first_s_ = 0.0, first_ok_s_ = -1.0, inlier_sum_ = 0.0, sd_sum_m_ = 0.0, update_sum_ms_ = 0.0,
         update_max_ms_ = 0.0;
};

void localize(const Options& options) {
  auto config = read_config_section<LocalizerNodeConfig>(options.config, "localizer");
  if (options.seed >= 0) config.localizer.seed = options.seed;
  const auto mapper_config = read_config_section<LocalMapperConfig>(options.config, "local_mapper");
  const MapDirectory map = load_map(options.map);
  for (const std::string& warning : map.warnings) fmt::print(stderr, "localize: {}\n", warning);
  ObservationReaderConfig reader_config;
  reader_config.source = options.raw_scan ? "scan" : options.from;
  ObservationReader reader(options.bag, reader_config, FrontEndConfig::from_file(options.config));

  Follower follower(config.localizer, mapper_config, options.raw_scan, options.only_ok);
  follower.localizer.set_map(map.distance);
  auto pose = config.initial_pose();
  if (!options.initial_pose.empty()) {
    pose = Pose2{options.initial_pose[0], options.initial_pose[1], options.initial_pose[2]};
  }
  if (pose) follower.localizer.initialize(*pose, config.initial_covariance());

  Progress progress("localize (" + reader.source() + ")");
  ObservationCallbacks callbacks;
  callbacks.add_odometry = [&](double stamp_s, const Pose2& T) { follower.add_odometry(stamp_s, T); };
  callbacks.profile = [&](const DepthProfile& profile, const Pose2& T) { follower.add(profile, T); };
  callbacks.scan = [&](const RangeScan& scan, const Pose2& T) { follower.add(scan, T); };
  callbacks.progress = [&](double fraction) {
    progress.update(fraction, fmt::format("{} scans, {}", follower.scans(),
                                          verdict_name(follower.localizer.result().verdict)));
  };
  const auto start = std::chrono::steady_clock::now();
  reader.read(callbacks);
  const double elapsed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  progress.update(1.0);
  for (const std::string& warning : reader.warnings()) fmt::print(stderr, "localize: {}\n", warning);
  if (follower.trajectory.empty()) {
    throw UserError(options.bag + ": the robot was never localized on " + options.map + ": " +
                    (follower.scans() == 0 ? "no scan could be used" : follower.localizer.result().reason) +
                    ".");
  }
  write_trajectory(options.trajectory, follower.trajectory);
  const double recording_s = reader.statistics().last_stamp_s - reader.statistics().first_stamp_s;
  nlohmann::json json = follower.figures();
  json["source"] = reader.source();
  json["recording_s"] = recording_s;
  json["elapsed_s"] = elapsed_s;
  json["speed_ratio"] = elapsed_s > 0.0 ? recording_s / elapsed_s : 0.0;
  json["map_checksum"] = map.checksum;
  json["seed"] = config.localizer.seed;
  write_json(options.json, json.dump(2));
  fmt::print(stderr, "{}: {} poses of {} scans, ok in {:.1f} %, {:.0f} s of recording in {:.1f} s\n",
             options.trajectory, follower.trajectory.size(), follower.scans(),
             100.0 * json["verdict_fractions"]["ok"].get<double>(), recording_s, elapsed_s);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(
      "Localizes the robot of a recording on a map: front end (if the recording has depth images and no "
      "profiles),\n"
      "local mapper and localizer. Writes the trajectory in the map's frame. The same bag, map, "
      "configuration and seed\n"
      "give the same bytes.");
  knav::Options options;
  app.add_option("BAG", options.bag, "recording with odometry and depth_profile, depth images or a LaserScan")
      ->required();
  app.add_option("--map", options.map, "map directory written by build_map, or a map_server YAML file")
      ->required();
  app.add_option("--trajectory", options.trajectory, "TUM text to write: t x y z qx qy qz qw")->required();
  app.add_option("--config", options.config, "configuration file, as config/default.yaml");
  app.add_option("--initial-pose", options.initial_pose,
                 "where the robot starts: x [m], y [m], heading [rad]; otherwise "
                 "the configuration's, otherwise the whole map is searched")
      ->expected(3);
  app.add_option("--seed", options.seed, "overrides localizer/seed")->check(CLI::NonNegativeNumber);
  app.add_option("--from", options.from, "what to start from")
      ->check(CLI::IsMember({"auto", "profile", "scan", "depth"}))
      ->capture_default_str();
  app.add_flag("--raw-scan", options.raw_scan,
               "use the recorded LaserScan and odometry alone, without the local mapper (as amcl)");
  app.add_flag("--only-ok", options.only_ok, "write only poses whose verdict is ok");
  app.add_option("--json", options.json, "write the figures to this file; '-' for standard output");
  app.footer(knav::kJsonHelp);
  return knav::run_command(app, argc, argv, [&] { knav::localize(options); });
}
