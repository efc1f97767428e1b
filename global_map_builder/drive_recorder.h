#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "global_map_builder/drive.h"
#include "global_map_builder/map_builder_config.h"
#include "tsdf_local_mapper/local_mapper.h"

namespace knav {

/// Runs the local mapper along a recording and keeps what the map is made of. Poses are in the frame `drive`:
/// the mapper's, carried over its epochs by odometry, with the first pose as origin.
class DriveRecorder {
 public:
  DriveRecorder(const DriveConfig& config, const LocalMapperConfig& mapper);

  void add_odometry(double stamp_s, const Pose2& T_odom_base);
  void add(const DepthProfile& profile, const Pose2& T_base_camera) { take(profile, T_base_camera); }
  void add(const RangeScan& scan, const Pose2& T_base_sensor) { take(scan, T_base_sensor); }
  /// The next frame stands at a marked place.
  void mark(double /*stamp_s*/) { mark_pending_ = true; }

  const Drive& drive() const { return drive_; }
  void set_name(const std::string& name) { drive_.name = name; }
  /// The drive, taken out; the recorder is then of no further use.
  Drive take_drive() { return std::move(drive_); }
  std::size_t refused() const { return refused_; }
  const std::string& last_refusal() const { return last_refusal_; }

 private:
  template <class Observation>
  void take(const Observation& observation, const Pose2& T_base_sensor);
  void add_keyframe(const LocalMapperResult& result, const Pose2& T_drive_base);

  DriveConfig config_;
  LocalMapperConfig mapper_config_;
  std::optional<LocalMapper> mapper_;  ///< from the first observation on, whose kind decides how it is set
  Trajectory early_odometry_;          ///< T_odom_base until then
  Drive drive_;
  Pose2 T_drive_local_;
  std::uint32_t epoch_ = 0;
  double path_m_ = 0.0;
  bool break_pending_ = false, mark_pending_ = false;
  std::size_t refused_ = 0;
  std::string last_refusal_;
};

}  // namespace knav
