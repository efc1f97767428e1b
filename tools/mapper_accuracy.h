#pragma once

#include <vector>

#include "tools/profile_recording.h"
#include "tools/trajectory_metrics.h"
#include "tsdf_local_mapper/local_mapper.h"

namespace knav {

/// The virtual scan beside a perfect scanner's, over the rays whose evidence is younger than 10 s.
/// A false obstacle is a return more than 0.3 m (and 5 %) nearer than anything within 0.1 m beside its ray; a
/// miss is a thing within 8 m that the ray passes by as much.
struct ScanAccuracy {
  std::uint64_t rays = 0;  ///< young enough: returns and rays seen free
  std::uint64_t false_obstacles = 0, misses = 0;
  std::vector<float> error_m;  ///< absolute, of returns whose true range is within 8 m, unsorted

  void add(const RangeScan& virtual_scan, double evidence_decay_s, const RangeScan& perfect);
  void add(const ScanAccuracy& other);
  double quantile_m(double share) const;  ///< NaN if there are none
};

/// Of what a perfect scanner sees within 8 m, how much the virtual scan shows, however long ago it was seen.
struct ScanShare {
  double stamp_s = 0.0, seen = 0.0;
  static ScanShare of(const RangeScan& virtual_scan, const RangeScan& perfect);
};

/// One drive.
struct MapperAccuracy {
  static constexpr double kLengths_m[3] = {20.0, 50.0, 100.0};
  ErrorStatistics segment[3];           ///< over kLengths_m
  ErrorStatistics odometry_segment[3];  ///< odometry alone
  bool lost = false;                    ///< some segment of 20 m is more than 2 m off
  int epochs = 1;
  double path_m = 0.0, duration_s = 0.0, elapsed_s = 0.0;
  std::vector<double> lifespan_s;  ///< of the generations of particles
  ScanAccuracy scan;
  std::vector<ScanShare> shares;
  Trajectory estimate, odometry;
  RangeOffsets learned;  ///< of the sensor, at the end
};

/// Maps a recorded drive and compares with the truth.
/// @param scans  compare the virtual scan too
/// @param known  what an earlier drive taught of the sensor, if anything
MapperAccuracy measure_mapper(const ProfileRecording& recording, const LocalMapperConfig& config, bool scans,
                              const RangeOffsets* known = nullptr);

}  // namespace knav
