#include "kinect_calib/extrinsics_calibrator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "core/error.h"
#include "kinect_calib/wall_tiles.h"

namespace knav {
namespace {

constexpr int kFewestFloorFrames = 10;
constexpr double kBlock_s = 1.0;
constexpr double kDegree = kPi / 180.0;

/// The median over seconds of each second's median: frames of one place share their errors.
template <class Floors, class Value>
Estimate over_blocks(const Floors& floors, const Value& value) {
  std::map<long, std::vector<double>> blocks;
  for (const auto& floor : floors)
    blocks[static_cast<long>(std::floor(floor.stamp_s / kBlock_s))].push_back(value(floor.mount));
  std::vector<double> medians;
  for (auto& [second, values] : blocks) medians.push_back(median_of(&values));
  const std::vector<double> all = medians;
  Estimate estimate;
  estimate.value = median_of(&medians);
  std::vector<double> off;
  for (const double one : all) off.push_back(std::abs(one - estimate.value));
  // 1.2533: a median's standard error over a mean's.
  estimate.sd = 1.2533 * 1.4826 * median_of(&off) / std::sqrt(static_cast<double>(all.size()));
  return estimate;
}

}  // namespace

void ExtrinsicsCalibrator::add_floor_frame(const cv::Mat& depth, const PinholeModel& camera, double stamp_s) {
  FloorMount mount;
  if (finder_.find(depth, camera, floor_frames_++, &mount)) floors_.push_back({stamp_s, mount});
}

FloorEstimate ExtrinsicsCalibrator::floor() const {
  if (floors_.size() < kFewestFloorFrames) {
    throw UserError(
        fmt::format("the floor is in view in {} of {} frames, and {} are needed: stand and drive where 1 to "
                    "4 m of bare floor lie "
                    "ahead, with the camera looking no higher than level.",
                    floors_.size(), floor_frames_, kFewestFloorFrames));
  }
  FloorEstimate estimate;
  estimate.frames = static_cast<int>(floor_frames_);
  estimate.frames_with_floor = static_cast<int>(floors_.size());
  estimate.height_m = over_blocks(floors_, [](const FloorMount& mount) { return mount.height_m; });
  estimate.pitch_rad = over_blocks(floors_, [](const FloorMount& mount) { return mount.pitch_rad; });
  estimate.roll_rad = over_blocks(floors_, [](const FloorMount& mount) { return mount.roll_rad; });
  return estimate;
}

void ExtrinsicsCalibrator::add_motion_frame(const cv::Mat& depth, const PinholeModel& camera,
                                            const FloorMount& mount, double stamp_s) {
  ++frames_;
  make_level_scan(depth, camera, mount, config_.timing, stamp_s, &scan_);
  ScanMotion motion;
  if (scan_odometry_.add(scan_, &motion)) motions_.push_back(motion);
}

void ExtrinsicsCalibrator::add_odometry(double stamp_s, const Pose2& T_odom_base) {
  if (odometry_.empty() || stamp_s > odometry_.back().stamp_s) odometry_.push_back({stamp_s, T_odom_base});
}

ExtrinsicsResult ExtrinsicsCalibrator::result() const {
  ExtrinsicsResult result;
  result.floor = floor();
  result.frames = frames_;
  result.aligned_frames = static_cast<int>(motions_.size());
  result.motion = compare_motions(motions_, odometry_);
  const MotionComparison& motion = result.motion;
  const double right_rad = motion.turned_rad - motion.turned_left_rad;
  if (odometry_.size() < 2) throw UserError("there is no odometry to compare the camera's motion with.");
  if (motion.turned_rad < config_.least_turn_rad ||
      std::min(motion.turned_left_rad, right_rad) < config_.least_turn_a_side_rad) {
    throw UserError(
        fmt::format("the drive turns {:.0f} degrees left and {:.0f} right; turn in place from standstill to "
                    "standstill, four times "
                    "by about 90 degrees, to both sides.",
                    motion.turned_left_rad / kDegree, right_rad / kDegree));
  }
  if (motion.driven_m < config_.least_drive_m) {
    throw UserError(fmt::format("the drive is {:.2f} m long; drive at least {:.1f} m straight on.",
                                motion.driven_m, config_.least_drive_m));
  }
  if (3 * result.aligned_frames < result.frames || 2 * motion.motions < result.aligned_frames ||
      !motion.turn_known || !motion.drive_known) {
    throw UserError(
        fmt::format("the camera's motion could be told in {} of {} frames, {} of them with odometry; walls, "
                    "not an empty hall or a "
                    "crowd, must fill the view within 5 m, and odometry must come without gaps.",
                    result.aligned_frames, result.frames, motion.motions));
  }
  if (motion.turn_scale.value < 0.0) {
    throw UserError("odometry turns right where the camera turns left: reverse the sign of its yaw first.");
  }
  if (std::abs(motion.turn_scale.value - 1.0) > config_.most_scale_error ||
      std::abs(motion.distance_scale.value - 1.0) > config_.most_scale_error) {
    throw UserError(
        fmt::format("odometry is far off: the camera turned {:.2f} and drove {:.2f} times what it says; "
                    "correct its scale first.",
                    motion.turn_scale.value, motion.distance_scale.value));
  }
  if (motion.time_offset_s.sd > config_.most_offset_sd_s) {
    throw UserError(
        fmt::format("the time offset would be uncertain by {:.0f} ms, and {:.0f} is the most: turn more "
                    "often from standstill to "
                    "standstill, briskly, where walls fill the view.",
                    1e3 * motion.time_offset_s.sd, 1e3 * config_.most_offset_sd_s));
  }
  if (motion.yaw_rad.sd > config_.most_yaw_sd_rad) {
    throw UserError(
        fmt::format("the camera's yaw would be uncertain by {:.2f} degrees, and {:.2f} is the most: drive "
                    "farther straight on, "
                    "towards walls that are not all parallel to the way.",
                    motion.yaw_rad.sd / kDegree, config_.most_yaw_sd_rad / kDegree));
  }
  return result;
}

}  // namespace knav
