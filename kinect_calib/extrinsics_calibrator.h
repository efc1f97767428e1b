#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "core/camera_model.h"
#include "core/trajectory.h"
#include "kinect_calib/floor_finder.h"
#include "kinect_calib/level_scan.h"
#include "kinect_calib/motion_comparison.h"

namespace knav {

struct ExtrinsicsConfig {
  FloorFinderConfig floor;
  ReadoutTiming timing;
  // What a drive must contain, by odometry.
  double least_turn_rad = kPi;  ///< in all
  double least_turn_a_side_rad = kPi / 3.0;
  double least_drive_m = 1.0;
  // What it must give; otherwise nothing is given.
  double most_yaw_sd_rad = 0.5 * kPi / 180.0;
  double most_offset_sd_s = 0.005;
  double most_scale_error = 0.2;
};

struct FloorEstimate {
  Estimate height_m, pitch_rad, roll_rad;
  int frames = 0, frames_with_floor = 0;
  FloorMount mount() const { return {height_m.value, pitch_rad.value, roll_rad.value}; }
};

struct ExtrinsicsResult {
  FloorEstimate floor;
  MotionComparison motion;
  int frames = 0, aligned_frames = 0;
};

/// Where the camera sits on the robot, and odometry's time against its own. Height, pitch and roll from the
/// floor over many frames (medians; standard errors between seconds of the drive), the rest by
/// compare_motions(). Two passes, as the second needs the level that the first finds. Standard errors know
/// nothing of what the sensor itself gets wrong: calibrate its depth first.
class ExtrinsicsCalibrator {
 public:
  explicit ExtrinsicsCalibrator(const ExtrinsicsConfig& config) : config_(config), finder_(config.floor) {}

  /// First pass. @param depth 32FC1 m, NaN invalid, rectified and corrected
  void add_floor_frame(const cv::Mat& depth, const PinholeModel& camera, double stamp_s);
  /// UserError if too few frames show floor.
  FloorEstimate floor() const;

  /// Second pass, in the order of stamps; `mount` is floor().mount().
  void add_motion_frame(const cv::Mat& depth, const PinholeModel& camera, const FloorMount& mount,
                        double stamp_s);
  /// In either pass, in the order of stamps; others are ignored.
  void add_odometry(double stamp_s, const Pose2& T_odom_base);
  /// UserError that says what the drive lacks.
  ExtrinsicsResult result() const;

 private:
  struct FloorFrame {
    double stamp_s;
    FloorMount mount;
  };

  ExtrinsicsConfig config_;
  FloorFinder finder_;
  std::uint64_t floor_frames_ = 0;
  std::vector<FloorFrame> floors_;
  ScanOdometry scan_odometry_;
  LevelScan scan_;
  std::vector<ScanMotion> motions_;
  Trajectory odometry_;
  int frames_ = 0;
};

}  // namespace knav
