#pragma once

#include <string>
#include <vector>

namespace knav {

/// What calibrate_depth learned about one sensor (paper section III.B). Tiles are row-major over the
/// rectified image; coefficients belong to tile centres and are interpolated between them.
struct DepthCalibration {
  std::string device;  ///< serial number or a name; free text
  int image_width_px = 640;
  int image_height_px = 480;
  int tile_px = 16;
  double trained_min_m = 0.5;  ///< nearest and farthest distance that was measured; beyond is extrapolated
  double trained_max_m = 4.0;

  /// Model `default`, in inverse depth, the sensor's own unit: 1/z_true = (1 + linear_slope) / z +
  /// linear_offset.
  std::vector<double> linear_slope, linear_offset_per_m;
  /// Model `offset`: 1/z_true = (1 + inverse_depth_scale) / z + inverse_depth_offset.
  double inverse_depth_scale = 0.0;
  std::vector<double> inverse_depth_offset_per_m;
  /// Model `paper`: D_k(u) = a u^2 + b u + c [m].
  std::vector<double> quadratic_a_per_m, quadratic_b, quadratic_c_m;
  /// 0 measured, 1 taken from the neighbours (too few readings, or off every smooth error).
  std::vector<int> tile_state;
  std::vector<double> tile_trained_max_m;  ///< the farthest wall each tile saw; 0 none

  int columns() const { return (image_width_px + tile_px - 1) / tile_px; }
  int rows() const { return (image_height_px + tile_px - 1) / tile_px; }
  std::size_t tile_count() const {
    return static_cast<std::size_t>(columns()) * static_cast<std::size_t>(rows());
  }

  /// All tiles say "no correction".
  static DepthCalibration identity(int width_px, int height_px, int tile_px);
  /// One sentence per fault.
  std::vector<std::string> validate() const;
};

/// Format `kinect_nav_depth_calibration`, version 2; version 1, which had no slopes, is read as well.
/// UserError names file, key and what is wrong.
DepthCalibration load_depth_calibration(const std::string& path);
/// Atomic.
void save_depth_calibration(const std::string& path, const DepthCalibration& calibration);

}  // namespace knav
