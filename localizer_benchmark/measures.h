#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/distance_map.h"
#include "localizer_benchmark/scan_recording.h"
#include "tsdf_localizer/localizer.h"

namespace knav {

/// What the localizer said after one scan, beside the truth.
struct Moment {
  double stamp_s = 0.0;
  double dt_s = 0.0;  ///< how long it held
  bool has_pose = false;
  LocalizationVerdict verdict = LocalizationVerdict::kInitializing;
  double error_m = 0.0, error_rad = 0.0;
  double support = 0.0, fresh_support = 0.0;
  Pose2 T_world_base;  ///< the truth
  bool ok() const { return verdict == LocalizationVerdict::kOk; }
};

/// Right: near enough to go on from.
constexpr double kRight_m = 0.3, kRight_deg = 5.0;
/// Wrong enough to hurt.
constexpr double kWrong_m = 0.5;

bool is_right(const Moment& moment);

/// How long a robot was how wrong. Rows of the report add up.
struct Honesty {
  double time_s = 0.0, ok_s = 0.0, uncertain_s = 0.0, lost_s = 0.0, initializing_s = 0.0;
  double ok_wrong_s = 0.0;  ///< ok while more than kWrong_m off
  void add(const Moment& moment);
  void add(const Honesty& other);
};

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

/// A drive whose start somebody has given.
TrackingScore measure_tracking(const ScanRecording& drive, const MapInWorld& map, const LocalizerConfig& config,
                               std::vector<Moment>* moments = nullptr);
/// Each stretch is a start without a hint: right within 30 s?
RecoveryScore measure_starts(const ScanRecording& starts, const MapInWorld& map, const LocalizerConfig& config);
/// Each stretch after the first begins with a kidnap: noticed within 5 s, right again within 40 s?
RecoveryScore measure_kidnaps(const ScanRecording& drive, const MapInWorld& map, const LocalizerConfig& config,
                              std::vector<Moment>* moments = nullptr);

}  // namespace knav
