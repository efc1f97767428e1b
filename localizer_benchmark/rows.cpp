#include "localizer_benchmark/rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>

#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"
#include "global_map_builder/map_directory.h"
#include "kinect_sim/tour_recorder.h"
#include "brin_benchmark/truth_map.h"
#include "tsdf_localizer/localizer_node_config.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

/// Raised whenever mapper or trials come to give other scans from the same parameters.
constexpr int kGeneration = 1;
constexpr double kDrive_m = 250.0;
constexpr double kQuick_s = 100.0;

template <class T>
double quantile(std::vector<T> values, double share) {
  if (values.empty()) return std::nan("");
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return static_cast<double>(values[static_cast<std::size_t>(at)]);
}

template <class T>
double mean(const std::vector<T>& values) {
  double sum = 0.0;
  for (const T v : values) sum += static_cast<double>(v);
  return values.empty() ? std::nan("") : sum / static_cast<double>(values.size());
}

nlohmann::json tracking_json(const TrackingScore& s) {
  const double deg = 180.0 / kPi;
  return {{"path_m", s.path_m}, {"honesty", to_json(s.honesty)}, {"lost_spans", s.lost_spans},
          {"mean_m", mean(s.error_m)}, {"p95_m", quantile(s.error_m, 0.95)}, {"worst_m", s.worst_m},
          {"worst_at", {{"s", s.worst_s}, {"x_m", s.worst_x_m}, {"y_m", s.worst_y_m}}},
          {"mean_deg", deg * mean(s.error_rad)}, {"p95_deg", deg * quantile(s.error_rad, 0.95)}, {"worst_deg", deg * quantile(s.error_rad, 1.0)}};
}

nlohmann::json recovery_json(const RecoveryScore& s) {
  return {{"trials", s.trials}, {"noticed", s.noticed}, {"right", s.right}, {"honesty", to_json(s.honesty)},
          {"noticed_median_s", quantile(s.noticed_s, 0.5)}, {"right_median_s", quantile(s.right_s, 0.5)},
          {"right_p95_s", quantile(s.right_s, 0.95)}, {"each", s.each}};
}

void write_trace(const std::string& path, const std::vector<Moment>& moments) {
  std::string text = "stamp_s\tverdict\terror_m\terror_deg\tsupport\tfresh_support\ttrue_x_m\ttrue_y_m\ttrue_yaw_rad\n";
  for (const Moment& m : moments) {
    text += fmt::format("{:.3f}\t{}\t{:.3f}\t{:.2f}\t{:.3f}\t{:.3f}\t{:.3f}\t{:.3f}\t{:.4f}\n", m.stamp_s, verdict_name(m.verdict), m.error_m,
                        m.error_rad * 180.0 / kPi, m.support, m.fresh_support, m.T_world_base.x_m, m.T_world_base.y_m, m.T_world_base.yaw_rad);
  }
  write_text_atomically(path, text);
}

template <class Config>
std::string described(Config config) {
  ConfigDescriber describer;
  config.visit(describer);
  std::string text;
  for (const ParameterDescription& p : describer.parameters) text += p.name + "=" + p.default_value + "\n";
  return text;
}

}  // namespace

const std::vector<std::string>& LocalizerRows::names() {
  static const std::vector<std::string> all = {"tracking", "changed", "plain57", "harsh", "starts", "ambiguous", "kidnaps"};
  return all;
}

LocalizerRows::LocalizerRows(const LocalizerBenchmarkOptions& options, const std::vector<BuildingSource>& sources)
    : options_(options),
      sources_(sources),
      recordings_(options.cache, options.fresh),
      mapper_config_(read_config_section<LocalMapperConfig>(options.config, "local_mapper")),
      localizer_config_(read_config_section<LocalizerNodeConfig>(options.config, "localizer").localizer) {
  mapper_config_.seed = localizer_config_.seed = options.seed;
  for (const BuildingSource& source : sources) buildings_.push_back(prepare_building(source, options.cache + "/worlds", options.seed));
}

const DistanceMap& LocalizerRows::truth(std::size_t building) {
  auto found = truth_.find(building);
  if (found == truth_.end()) found = truth_.emplace(building, truth_map(load_world(buildings_[building].world_file))).first;
  return found->second;
}

MapInWorld LocalizerRows::map_of(std::size_t building) {
  const auto directory = options_.maps.find(buildings_[building].name);
  if (directory == options_.maps.end()) return {truth(building), Pose2()};
  // The map's origin is where its drive began.
  return {load_map(directory->second).distance, load_world(buildings_[building].world_file).spawn};
}

SimulatedDrive LocalizerRows::drive_of(std::size_t building, bool changed, const std::string& sensor, int k, bool laid_out) const {
  const Building& b = buildings_[building];
  SimulatedDrive drive;
  drive.world_file = changed ? b.changed_file : b.world_file;
  drive.sensor = sensor;
  drive.seed = options_.seed + k;
  drive.front_end = FrontEndConfig::from_file(options_.config);
  if (options_.quick) drive.limit_s = kQuick_s;
  drive.tour_file = b.tour_file;
  if (changed || laid_out || b.tour_file.empty()) {
    drive.tour_file = fmt::format("{}/worlds/{}{}-{}_tour.yaml", options_.cache, b.name, changed ? "_changed" : "", drive.seed);
    write_text_atomically(drive.tour_file, lay_out_drive(load_world(drive.world_file), std::min(kDrive_m, options_.metres), drive.seed));
  }
  return drive;
}

/// Among people and moved furniture a drive laid out beforehand may end before somebody; another seed's is taken then.
std::optional<ProfileRecording> LocalizerRows::drive_unless_stuck(const SimulatedDrive& drive) {
  const std::string stuck_file = recordings_.path_of(drive) + ".stuck";
  if (!options_.fresh && fs::exists(stuck_file)) return std::nullopt;
  try {
    return recordings_.get(drive);
  } catch (const NoHeadway& stuck) {
    fmt::print(stderr, "{} Another drive takes its place.\n", stuck.what());
    write_text_atomically(stuck_file, std::string(stuck.what()) + "\n");
    return std::nullopt;
  }
}

LocalizerRows::Drives LocalizerRows::drives(std::size_t building, bool changed, const std::string& sensor, double metres, bool laid_out) {
  Drives drives;
  const int count = options_.quick ? 1 : std::max(1, static_cast<int>(std::ceil(metres / kDrive_m - 0.2)));  // laid-out drives are a little longer
  for (int k = 0; static_cast<int>(drives.profiles.size()) < count; ++k) {
    const SimulatedDrive drive = drive_of(building, changed, sensor, k, laid_out);
    if (k > 2 * count + 2) throw UserError(drive.world_file + ": the robot gets stuck on most drives laid out through it.");
    if (std::optional<ProfileRecording> profiles = drive_unless_stuck(drive)) {
      drives.profiles.push_back(std::move(*profiles));
      drives.identity += recordings_.path_of(drive) + "\n";
    }
  }
  return drives;
}

ScanRecording LocalizerRows::scans(const Drives& drives, const std::vector<Stretch>& stretches, Link link, const std::string& stem) {
  std::string decides = fmt::format("{} {}\n", kGeneration, static_cast<int>(link)) + drives.identity + described(mapper_config_);
  for (const Stretch& s : stretches) decides += fmt::format("{} {} {}\n", s.drive, s.first, s.last);
  const std::string path = fmt::format("{}/{}-{:016x}.scans", options_.cache, stem, std::hash<std::string>{}(decides));
  if (!options_.fresh_scans && fs::exists(path)) return ScanRecording::load(path);
  const ScanRecording recording = record_scans(drives.profiles, stretches, link, mapper_config_);
  recording.save(path);
  return recording;
}

std::vector<ScanRecording> LocalizerRows::tracking_scans(const std::string& row, std::size_t building) {
  const std::string sensor = row == "harsh" ? "harsh" : "calibrated";
  std::vector<ScanRecording> all;
  const Drives d = drives(building, row == "changed", sensor, row == "harsh" ? std::min(kDrive_m, options_.metres) : options_.metres, false);
  for (std::size_t k = 0; k < d.profiles.size(); ++k) {
    if (row == "plain57") {
      all.push_back(record_plain_scans(d.profiles[k]));
      continue;
    }
    Drives one;
    one.profiles.push_back(d.profiles[k]);
    one.identity = fmt::format("{} of {}", k, d.identity);
    // so that a row of fewer metres finds them too
    std::size_t at = 0;
    for (std::size_t i = 0; i < k; ++i) at = d.identity.find('\n', at) + 1;
    one.identity = d.identity.substr(at, d.identity.find('\n', at) - at);
    all.push_back(scans(one, {{0, 0, d.profiles[k].frames()}}, Link::kAnew, fmt::format("{}-{}-{}", buildings_[building].name, row, k)));
  }
  return all;
}

std::size_t LocalizerRows::share(int trials) const {
  if (options_.quick) return 3;
  return static_cast<std::size_t>(std::ceil(static_cast<double>(trials) / static_cast<double>(buildings_.size())));
}

ScanRecording LocalizerRows::start_scans(std::size_t building, bool unique, nlohmann::json* json) {
  const Drives d = drives(building, false, "calibrated", options_.metres, false);
  const std::size_t wanted = share(options_.starts);
  Starts starts = find_starts(d.profiles, truth(building), wanted);
  if (json) {
    (*json)["found_unique"] = starts.unique.size();
    (*json)["found_ambiguous"] = starts.ambiguous.size();
  }
  starts.ambiguous.resize(std::min(starts.ambiguous.size(), std::max<std::size_t>(1, wanted / 3)));
  return scans(d, unique ? starts.unique : starts.ambiguous, Link::kAnew, buildings_[building].name + (unique ? "-starts" : "-ambiguous"));
}

/// Made anew each time: a kidnapped robot's mapper goes by what the localizer says.
ScanRecording LocalizerRows::kidnap_scans(std::size_t building, const MapInWorld& map) {
  const Drives d = drives(building, false, "calibrated", kDrive_m, true);
  KidnappedLocalizer localizer(map, localizer_config_);
  return record_scans(d.profiles, lay_out_kidnaps(d.profiles, share(options_.kidnaps), options_.seed), Link::kKidnapped, mapper_config_,
                      [&](const ScanRecording& recording, std::size_t i) { return !localizer.ask(recording, i).ok(); });
}

void LocalizerRows::record(const std::string& row, std::size_t building) {
  if (row == "starts" || row == "ambiguous") {
    start_scans(building, row == "starts", nullptr);
  } else if (row == "kidnaps") {
    drives(building, false, "calibrated", kDrive_m, true);
  } else {
    tracking_scans(row, building);
  }
}

nlohmann::json LocalizerRows::measure(const std::string& row, std::size_t building, const std::string& trace) {
  nlohmann::json json = {{"row", row}, {"building", buildings_[building].name}, {"map", options_.maps.count(buildings_[building].name) ? "built" : "truth"}};
  if (row == "changed") json["changes"] = buildings_[building].changes;
  const MapInWorld map = map_of(building);
  if (row == "starts" || row == "ambiguous") {
    json.update(recovery_json(measure_starts(start_scans(building, row == "starts", &json), map, localizer_config_)));
    return json;
  }
  if (row == "kidnaps") {
    std::vector<Moment> moments;
    json.update(recovery_json(measure_kidnaps(kidnap_scans(building, map), map, localizer_config_, &moments)));
    if (!trace.empty()) write_trace(fmt::format("{}/{}-kidnaps.tsv", trace, buildings_[building].name), moments);
    return json;
  }
  TrackingScore all;
  std::size_t k = 0;
  for (const ScanRecording& drive : tracking_scans(row, building)) {
    std::vector<Moment> moments;
    const TrackingScore score = measure_tracking(drive, map, localizer_config_, &moments);
    json["drives"].push_back(tracking_json(score));
    all.add(score);
    if (!trace.empty()) write_trace(fmt::format("{}/{}-{}-{}.tsv", trace, buildings_[building].name, row, k), moments);
    ++k;
  }
  json.update(tracking_json(all));
  return json;
}

}  // namespace knav
