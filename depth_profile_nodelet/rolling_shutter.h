#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "core/pose_buffer.h"
#include "depth_profile_nodelet/edge_straightener.h"
#include "depth_profile_nodelet/row_warp.h"

namespace knav {

struct RollingShutterConfig {
  std::string method = "default";
  double readout_s = 1.0 / 30.0;
  double stamp_row_fraction = 0.5;
  double time_offset_s = 0.0;
  bool straighten_edges = true;
  double odometry_gap_s = 0.25;
  double odometry_extrapolation_s = 0.1;

  template <class Visitor>
  void visit(Visitor& v) {
    v.choice(
        "method", method, {"paper", "default", "off"},
        "paper: rows shifted by whole pixels. default: each column by its own amount, depth turned as well.");
    v.number("readout_s", readout_s, 0, 0.1, "s", "From the first row's exposure to the last row's.");
    v.number("stamp_row_fraction", stamp_row_fraction, 0, 1, "",
             "Which row the stamp means: 0 the first, 0.5 the middle, 1 the last.");
    v.number("time_offset_s", time_offset_s, -0.5, 0.5, "s",
             "Added to a depth stamp to get odometry's time.");
    v.flag("straighten_edges", straighten_edges,
           "default: place upright edges by the mean over many rows, to better than a pixel.");
    v.number("odometry_gap_s", odometry_gap_s, 0.01, 5, "s",
             "Odometry is not interpolated over longer gaps.");
    v.number("odometry_extrapolation_s", odometry_extrapolation_s, 0, 1, "s",
             "A row may be this much newer than the newest odometry.");
  }
  std::vector<std::string> validate() const { return {}; }
};

/// Paper section III.C: the sensor reads its rows one after another, so a turning robot shears the image.
/// Every row is turned about the vertical axis from where the robot looked when it was read to where it
/// looked at the stamp's row. Translation within a frame (at most 1 cm at 0.6 m/s) is left alone.
class RollingShutterCorrector {
 public:
  explicit RollingShutterCorrector(const RollingShutterConfig& config) : config_(config) {}

  enum class Outcome { kCorrected, kStill, kNoOdometry };
  /// @param depth     32FC1 m, NaN invalid
  /// @param odometry  poses of the base; the camera turns with it
  /// @param unrolled  same size, written only for kCorrected: otherwise `depth` itself is what to go on with
  Outcome correct(const cv::Mat& depth, const PinholeModel& camera, double stamp_s,
                  const PoseBuffer& odometry, cv::Mat* unrolled);

 private:
  bool look_up(const PoseBuffer& odometry, double stamp_s, Pose2* T_odom_base) const;

  RollingShutterConfig config_;
  RowWarp warp_;
  EdgeStraightener edges_;
  std::vector<double> row_yaw_rad_;
};

}  // namespace knav
