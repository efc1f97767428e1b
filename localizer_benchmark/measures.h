#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "brin_benchmark/localization_watch.h"
#include "core/distance_map.h"
#include "localizer_benchmark/scan_recording.h"
#include "tsdf_localizer/localizer.h"

namespace knav {

struct TrackingScore {
  Honesty honesty;
  double path_m = 0.0;
  std::vector<float> error_m, error_rad;  ///< per scan with a pose
  int lost_spans = 0;                     ///< more than a metre off for more than five seconds
  double worst_m = 0.0, worst_s = 0.0, worst_x_m = 0.0, worst_y_m = 0.0;  ///< where and when
  void add(const TrackingScore& other);
};

struct RecoveryScore {
  Honesty honesty;
  int trials = 0, noticed = 0, right = 0;
  std::vector<double> noticed_s, right_s;  ///< of those that did
  nlohmann::json each = nlohmann::json::array();
  void add(const RecoveryScore& other);
};

/// @param T_world_map of the map's frame
struct MapInWorld {
  DistanceMap map;
  Pose2 T_world_map;
};

/// The localizer of a robot that is told where it starts and then carried elsewhere at the beginning of each further stretch. If it has not found
/// itself when the time for that is over, it is told.
class KidnappedLocalizer {
 public:
  KidnappedLocalizer(const MapInWorld& map, const LocalizerConfig& config);
  /// @param i frame of the recording, in order; the recording may still be growing
  Moment ask(const ScanRecording& drive, std::size_t i);

 private:
  MapInWorld map_;
  Localizer localizer_;
  RangeScan scan_;
  Moment last_;
  bool helped_ = false;
};

/// A drive whose start somebody has given.
TrackingScore measure_tracking(const ScanRecording& drive, const MapInWorld& map, const LocalizerConfig& config,
                               std::vector<Moment>* moments = nullptr);
/// Each stretch is a start without a hint: right within 30 s?
RecoveryScore measure_starts(const ScanRecording& starts, const MapInWorld& map, const LocalizerConfig& config);
/// Each stretch after the first begins with a kidnap: noticed within 5 s, right again within 40 s?
RecoveryScore measure_kidnaps(const ScanRecording& drive, const MapInWorld& map, const LocalizerConfig& config,
                              std::vector<Moment>* moments = nullptr);

}  // namespace knav
