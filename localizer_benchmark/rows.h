#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "localizer_benchmark/building.h"
#include "localizer_benchmark/measures.h"
#include "localizer_benchmark/trials.h"
#include "tools/simulated_recordings.h"

namespace knav {

struct LocalizerBenchmarkOptions {
  std::string cache, config;
  double metres = 1000.0;        ///< of driving, per row of tracking
  int starts = 100, kidnaps = 100;  ///< over all buildings
  int seed = 1;
  bool quick = false, fresh = false, fresh_scans = false;
  std::map<std::string, std::string> maps;  ///< building -> map directory to localize in instead of the truth
};

/// Makes and keeps what the rows of the table are measured with, and measures them.
class LocalizerRows {
 public:
  LocalizerRows(const LocalizerBenchmarkOptions& options, const std::vector<BuildingSource>& sources);

  static const std::vector<std::string>& names();
  /// One row in one building: kind, building, and all figures; `trace` is a folder for a TSV of every scan, or empty.
  nlohmann::json measure(const std::string& row, std::size_t building, const std::string& trace);
  /// Simulates and maps only.
  void record(const std::string& row, std::size_t building);
  const Building& building(std::size_t i) const { return buildings_[i]; }

 private:
  struct Drives {
    std::vector<ProfileRecording> profiles;
    std::string identity;
  };
  SimulatedDrive drive_of(std::size_t building, bool changed, const std::string& sensor, int k, bool laid_out) const;
  std::optional<ProfileRecording> drive_unless_stuck(const SimulatedDrive& drive);
  Drives drives(std::size_t building, bool changed, const std::string& sensor, double metres, bool laid_out);
  ScanRecording scans(const Drives& drives, const std::vector<Stretch>& stretches, Link link, const std::string& stem);
  const DistanceMap& truth(std::size_t building);
  MapInWorld map_of(std::size_t building);
  std::vector<ScanRecording> tracking_scans(const std::string& row, std::size_t building);
  ScanRecording start_scans(std::size_t building, bool unique, nlohmann::json* json);
  ScanRecording kidnap_scans(std::size_t building, const MapInWorld& map);
  std::size_t share(int trials) const;

  LocalizerBenchmarkOptions options_;
  std::vector<BuildingSource> sources_;
  std::vector<Building> buildings_;
  std::map<std::size_t, DistanceMap> truth_;
  SimulatedRecordings recordings_;
  LocalMapperConfig mapper_config_;
  LocalizerConfig localizer_config_;
};

}  // namespace knav
