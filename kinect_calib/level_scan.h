#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "core/camera_model.h"
#include "core/pose2.h"
#include "kinect_calib/floor_finder.h"

namespace knav {

/// When the rows of an image are read.
struct ReadoutTiming {
  double readout_s = 1.0 / 30.0;  ///< from the first row's exposure to the last row's
  double stamp_row_fraction = 0.5;
};

/// What a narrow band of rows about the horizon sees, level: read within 3 ms, so that a turning robot does
/// not shear it. A point is (forward, left) = (1, slope) / per_m.
struct LevelScan {
  double stamp_s = 0.0;  ///< when the band's middle row was read
  std::vector<double> slope, per_m;
  /// The wall about each point, per_m = line_at + line_per_slope * slope; NaN where it is none.
  std::vector<double> line_at, line_per_slope;
};

/// @param depth 32FC1 m, NaN invalid, rectified
void make_level_scan(const cv::Mat& depth, const PinholeModel& camera, const FloorMount& mount,
                     const ReadoutTiming& timing, double stamp_s, LevelScan* scan);

/// How the level camera moved between two scans.
struct ScanMotion {
  double from_s = 0.0, to_s = 0.0;
  Pose2 T_from_to;
  Eigen::Matrix3d information =
      Eigen::Matrix3d::Zero();  ///< of (x m, y m, yaw rad): small where nothing tells
  int columns = 0;              ///< that agreed
};

/// Aligns `to` with the walls of `from`, starting at motion->T_from_to. Residuals are in disparity, where the
/// noise is uniform. @return false if too little agrees
bool align_scans(const LevelScan& from, const LevelScan& to, ScanMotion* motion);

/// Camera motion from a sequence of scans: each is aligned with a scan up to 12 degrees or 0.25 m back,
/// without odometry, so that it can be compared with it.
class ScanOdometry {
 public:
  /// Scans in the order of their stamps. @return false for the first scan and where alignment failed
  bool add(const LevelScan& scan, ScanMotion* motion);

 private:
  LevelScan key_;
  bool any_ = false;
  Pose2 T_key_previous_, T_step_;  // T_step_: what the last interval brought
};

}  // namespace knav
