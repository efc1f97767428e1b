#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "kinect_calib/deband.h"
#include "kinect_calib/depth_calibration.h"

namespace knav {

struct DepthCalibratorConfig {
  int tile_px = 16;
  bool deband = true;
  bool fit_wall_tilt = true;  ///< the robot may stand a degree off square
  double range_finder_sd_m = 0.002;
  /// Only readings within this share of the distance, growing with it as the sensor's error does, are the
  /// wall's.
  double wall_gate = 0.03, wall_gate_per_m = 0.02;
  double sensor_sd_per_m = 3e-4;  ///< of a tile's mean in inverse depth, once noise is averaged away
};

/// What one wall distance says about a calibration.
struct WallScore {
  double distance_m = 0.0;
  int frames = 0;
  double mean_bias_before = 0.0, mean_bias_after = 0.0,
         mean_bias_after_paper = 0.0;  ///< relative, frame-wide
  double tile_bias_p95_before = 0.0, tile_bias_p95_after = 0.0,
         tile_bias_p95_after_paper = 0.0;  ///< relative
};

/// Learns the depth error of a sensor from frames of a flat wall at known distances (paper section III.B):
/// bands are removed per frame, frames averaged per tile, and per tile an offset in inverse depth and the
/// paper's quadratic fitted.
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
  /// How the frames added fare under a calibration, nearest wall first.
  std::vector<WallScore> score(const DepthCalibration& calibration) const;

 private:
  struct Wall {
    double distance_m = 0.0;
    int frames = 0;
    std::vector<double> inverse_per_m, count;  // per tile, summed over frames
    double tilt_x = 0.0, tilt_y = 0.0;         // 1 / z = (1 + tilt_x x + tilt_y y) / distance
    bool has(std::size_t tile) const { return count[tile] > 0.0; }
    double measured_per_m(std::size_t tile) const { return inverse_per_m[tile] / count[tile]; }
  };
  void average_tiles();
  void keep_wall_tiles(double distance_m);
  double true_per_m(const Wall& wall, std::size_t tile) const;
  double weight(const Wall& wall) const;
  void fit_scale_and_tilts(DepthCalibration* calibration);
  void fit_offsets(DepthCalibration* calibration) const;
  void fit_quadratics(DepthCalibration* calibration) const;
  void mend_tiles(DepthCalibration* calibration);

  DepthCalibratorConfig config_;
  PinholeModel camera_;
  DepthCalibration layout_;
  std::vector<double> tile_x_, tile_y_;  // normalised image coordinates of the tile centres
  std::vector<Wall> walls_;
  Debander debander_;
  cv::Mat frame_;
  std::vector<double> frame_per_m_;  // per tile
  bool offsets_known_ = false;
  int filled_tiles_ = 0;
};

}  // namespace knav
