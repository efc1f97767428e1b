#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "core/camera_model.h"

namespace knav {

/// Square tiles over an image, row-major, with the normalised image coordinates of their centres.
struct TileGrid {
  int columns = 0, rows = 0, tile_px = 16;
  std::vector<double> x, y;

  TileGrid() = default;
  TileGrid(const PinholeModel& camera, int tile_px);
  std::size_t count() const { return x.size(); }
  std::size_t index(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(column);
  }
};

/// Finds in a frame what belongs to a flat wall, always on tiles of 16 px, and averages it on tiles of any
/// size.
class WallTiles {
 public:
  static constexpr int kGateTile_px = 16;

  static constexpr double kMostTilt = 0.12;  ///< tangent of how far off square a wall may be

  explicit WallTiles(const PinholeModel& camera) : grid_(camera, kGateTile_px) {}

  /// @param frame      32FC1 m, NaN invalid
  /// @param distance_m from the camera to the wall along the optical axis
  /// UserError if too little of the frame is a wall at that distance, or the wall is far off square.
  void find(const cv::Mat& frame, double distance_m);
  /// Mean inverse depth [1/m] per tile of `grid` over the wall's pixels; NaN where too little answered.
  /// find() first, with the same frame.
  void average(const cv::Mat& frame, const TileGrid& grid, std::vector<double>* per_m) const;

  /// Mean inverse depth [1/m] per tile of 16 px, NaN where too little answered or what answers is floor.
  const std::vector<double>& average_gate_tiles(const cv::Mat& frame);
  const TileGrid& gate_grid() const { return grid_; }

 private:
  TileGrid grid_;
  std::vector<double> per_m_;  // NaN: not the wall
};

double median_of(std::vector<double>* values);

}  // namespace knav
