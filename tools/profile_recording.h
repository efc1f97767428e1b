#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/depth_profile.h"
#include "core/range_scan.h"
#include "core/trajectory.h"

namespace knav {

/// A simulated drive as the mapper sees it (profiles and odometry), with the truth. Distances are kept in
/// steps of half a millimetre, which is far below the sensor's own, so that minutes of driving fit in memory.
class ProfileRecording {
 public:
  /// What a perfect planar scanner all round would see, 0 ... 32 m, at the stamp of a frame.
  struct PerfectScan {
    std::size_t frame = 0;  ///< taken at this frame's stamp
    std::vector<std::uint16_t>
        range;  ///< rays from -pi on, in steps; nearest thing at any height of the slice
  };

  Pose2 T_base_camera;
  Trajectory odometry, truth;  ///< T_odom_base, T_world_base at odometry's rate
  std::vector<PerfectScan> perfect_scans;

  void add(const DepthProfile& profile);
  void add_perfect_scan(std::size_t frame, const std::vector<float>& range_m);

  std::size_t frames() const { return stamp_s_.size(); }
  double stamp_s(std::size_t i) const { return stamp_s_[i]; }
  /// Reuses the memory of *profile.
  void profile(std::size_t i, DepthProfile* profile) const;
  static void perfect_scan(const PerfectScan& scan, RangeScan* out);

  /// Atomic. The bytes are those of this machine (little endian).
  void save(const std::string& path) const;
  /// UserError if the file is none of ours or cut short.
  static ProfileRecording load(const std::string& path);

 private:
  double fx_px_ = 0.0, cx_px_ = 0.0, camera_height_m_ = 0.0, range_max_m_ = 0.0;
  std::uint64_t columns_ = 0;
  std::vector<double> stamp_s_;
  std::vector<std::uint16_t> z_, free_from_, free_to_;  ///< frame by frame
  std::vector<std::uint8_t> height_class_, rows_;
};

}  // namespace knav
