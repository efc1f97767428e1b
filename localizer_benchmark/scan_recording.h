#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/pose2.h"
#include "core/range_scan.h"
#include "tools/profile_recording.h"
#include "tsdf_local_mapper/local_mapper_config.h"

namespace knav {

/// What the localizer is given in a drive, with the truth beside it. Made once by the local mapper, which hears nothing of the
/// localizer but its doubt; where that matters little it can then be measured again and again in a fraction of the time.
struct ScanRecording {
  struct Frame {
    double stamp_s = 0.0;
    Pose2 T_local_base, T_odom_base, T_world_base;  ///< the last is the truth
    std::uint32_t epoch = 0;
  };
  Pose2 T_base_sensor;
  double angle_min_rad = 0.0, angle_increment_rad = 0.0, range_min_m = 0.0, range_max_m = 0.0;
  std::vector<Frame> frames;
  std::vector<std::size_t> begins;  ///< frames at which the robot finds itself elsewhere; the first is 0

  void add(const Frame& frame, const RangeScan& scan);
  void scan(std::size_t i, RangeScan* out) const;

  /// Atomic.
  void save(const std::string& path) const;
  /// UserError if the file is none of ours or cut short.
  static ScanRecording load(const std::string& path);

 private:
  std::uint64_t rays_ = 0;
  std::vector<std::uint16_t> range_;    ///< half millimetres
  std::vector<std::uint8_t> evidence_;  ///< 1/255
};

/// A stretch of a recorded drive.
struct Stretch {
  std::size_t drive = 0;  ///< which recording
  std::size_t first = 0, last = 0;  ///< frames [first, last)
};

enum class Link {
  kAnew,      ///< each stretch is a robot switched on
  kKidnapped  ///< the robot is carried from one stretch to the next while everything runs and the wheels stand
};

/// Whether the localizer is in doubt after the newest frame of the recording.
using InDoubt = std::function<bool(const ScanRecording&, std::size_t frame)>;

/// The local mapper along stretches of drives.
/// @param in_doubt what the mapper is told after each frame; empty: no doubt
ScanRecording record_scans(const std::vector<ProfileRecording>& drives, const std::vector<Stretch>& stretches, Link link,
                           const LocalMapperConfig& config, const InDoubt& in_doubt = {});
/// The whole of one drive without the local mapper: the 57-degree scan of each frame, and odometry.
ScanRecording record_plain_scans(const ProfileRecording& drive);

}  // namespace knav
