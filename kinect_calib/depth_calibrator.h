#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "kinect_calib/deband.h"
#include "kinect_calib/depth_calibration.h"
#include "kinect_calib/depth_corrector.h"
#include "kinect_calib/disparity_fit.h"
#include "kinect_calib/wall_measurement.h"
#include "kinect_calib/wall_tiles.h"

namespace knav {

struct DepthCalibratorConfig {
  int tile_px = 16;
  bool deband = true;
  bool fit_wall_tilt = true;  ///< the robot may stand a degree off square
  double range_finder_sd_m = 0.002;
  /// Only readings within this share of the distance, growing with it as the sensor's error does, are the
  /// wall's.
  double wall_gate = 0.03, wall_gate_per_m = 0.02;
  double wall_tilt_sd = 0.01;  ///< how far one wall is off square beside what all have in common (tangent)
};

/// What one wall distance says about a calibration; biases are relative to the distance.
struct WallScore {
  double distance_m = 0.0;
  int frames = 0;
  /// Frame-wide.
  double mean_bias_before = 0.0, mean_bias_after = 0.0, mean_bias_after_offset = 0.0,
         mean_bias_after_paper = 0.0;
  /// 95th percentile over tiles of the absolute bias.
  double tile_bias_p95_before = 0.0, tile_bias_p95_after = 0.0, tile_bias_p95_after_offset = 0.0,
         tile_bias_p95_after_paper = 0.0;
};

/// Learns the depth error of a sensor from frames of a flat wall at known distances (paper section III.B):
/// bands are removed per frame, frames averaged per tile, and every model that depth_correction knows is
/// fitted.
class DepthCalibrator {
 public:
  explicit DepthCalibrator(const DepthCalibratorConfig& config) : config_(config) {}

  /// @param depth_m    32FC1 m, NaN invalid, lens rectified
  /// @param distance_m from the camera to the wall along the optical axis
  /// Frames at the same distance (1 cm or 0.5 %) are averaged. UserError if the size changes or the frame
  /// shows no wall.
  void add_frame(const cv::Mat& depth_m, const PinholeModel& camera, double distance_m);
  int distances() const { return static_cast<int>(walls_.size()); }

  /// UserError if there are too few distances to extrapolate from.
  DepthCalibration fit();
  /// After fit(): tiles that neighbours had to fill in.
  int filled_tiles() const { return filled_tiles_; }
  /// After fit(): of those, the ones whose readings fit no smooth error.
  int wild_tiles() const { return wild_tiles_; }
  /// After fit(): tiles whose quadratic had to be held from bending back.
  int held_quadratics() const { return held_quadratics_; }
  /// The walls added, nearest first after fit(), on tiles of 16 px.
  const std::vector<WallMeasurement>& walls() const { return walls_; }
  /// How the frames added fare under a calibration, nearest wall first, on tiles of 16 px.
  std::vector<WallScore> score(const DepthCalibration& calibration) const;
  /// Relative bias of each tile of 16 px of one of walls() under a corrector, NaN where the wall was not
  /// seen; without a corrector the raw bias.
  std::vector<double> tile_bias(const WallMeasurement& wall, const DepthCorrector* corrector) const;
  const TileGrid& grid() const { return grid_; }

 private:
  DisparityPriors priors() const;
  void add_to(const std::vector<double>& per_m, double distance_m, std::vector<WallMeasurement>* walls);

  DepthCalibratorConfig config_;
  PinholeModel camera_;
  TileGrid grid_, fine_grid_;  // of 16 px; of config_.tile_px
  std::unique_ptr<WallTiles> tiles_;
  std::vector<WallMeasurement> walls_, fine_walls_;  // the second only where tiles are not of 16 px
  Debander debander_;
  cv::Mat frame_;
  std::vector<double> per_m_;
  int filled_tiles_ = 0, wild_tiles_ = 0, held_quadratics_ = 0;
};

}  // namespace knav
