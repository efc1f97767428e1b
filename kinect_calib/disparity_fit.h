#pragma once

#include <vector>

#include "kinect_calib/wall_measurement.h"
#include "kinect_calib/wall_tiles.h"

namespace knav {

/// How much is believed beforehand. Units: inverse depth [1/m]; a disparity code is 2.85e-3 1/m.
struct DisparityPriors {
  double range_finder_sd_m = 0.002;
  double frame_mean_sd_per_m = 1.5e-4;  ///< of a frame's mean: what bands leave
  double tile_sd_per_m = 4e-4;          ///< of a tile's mean that no averaging removes: bands
  double noise_sd_per_m = 1.6e-3;       ///< of one pixel
  double noise_area_px = 88;            ///< pixels that share their noise
  double wall_tilt_sd = 0.01, mount_tilt_sd = 0.1;
  double scale_sd = 0.03, common_offset_sd_per_m = 0.05;
  double offset_sd_per_m = 0.2;  ///< loose: any more would drive what is linear across the image into tilts
  double slope_sd = 0.02;
  /// Second derivative of offset and slope across the image.
  double offset_curvature_sd_per_m_px2 = 1e-5, slope_curvature_sd_per_px2 = 5e-6;
  bool slopes = true;  ///< false: the offset alone
};

/// 1 / z_true = (1 + scale) ((1 + slope) / z + offset) + common_offset. Scale and common offset stand apart
/// because only the range finder knows them: together with errors of the ranges they leave every reading as
/// it is, and were they part of slope and offset, whose priors gain by shrinking, the scale would shrink
/// along.
struct DisparityField {
  double scale = 0.0, common_offset_per_m = 0.0;
  std::vector<double> slope, offset_per_m;
  std::vector<char> wild;  ///< tiles whose readings no smooth field explains; their readings were left out

  /// In the form of the model: 1 / z_true = (1 + total_slope) / z + total_offset.
  double total_slope(std::size_t tile) const { return (1.0 + scale) * (1.0 + slope[tile]) - 1.0; }
  double total_offset_per_m(std::size_t tile) const {
    return (1.0 + scale) * offset_per_m[tile] + common_offset_per_m;
  }
};

/// Fits the field and, jointly, what is not known of each wall: the error of its distance and its tilts
/// (written into `walls`). The two are not fitted in turns: they would creep towards each other over hundreds
/// of rounds. Tilts that grow with distance look exactly like an offset that is linear across the image, and
/// one slope that is linear across it like a tilted mount; so a wall's own tilt is small, the mount's common
/// tilt free, and slopes are small. Offset and slope are smooth (small second derivatives), which fills tiles
/// without readings as well.
DisparityField fit_disparity(const TileGrid& grid, const DisparityPriors& priors,
                             std::vector<WallMeasurement>* walls);

/// The same on another grid with what is known of the walls taken from the first; `walls` are of that grid.
/// @param start of `start_grid`
DisparityField refit_disparity(const TileGrid& grid, const DisparityPriors& priors,
                               const std::vector<WallMeasurement>& walls, const TileGrid& start_grid,
                               const DisparityField& start);

/// Bilinear between tile centres, constant outside the outermost ones.
double interpolate_tiles(const TileGrid& grid, const std::vector<double>& values, double u_px, double v_px);

}  // namespace knav
