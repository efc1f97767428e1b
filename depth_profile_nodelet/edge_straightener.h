#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "depth_profile_nodelet/row_warp.h"

namespace knav {

/// Upright edges to a fraction of a pixel, from many rows of a turning camera. The sensor rounds an edge to a
/// pixel, unrolling rounds it once more: sqrt(2 / 12) = 0.41 px for a row by itself. But the shift differs
/// from row to row, so each row samples the same edge at another fraction of a pixel, and their mean knows it
/// to a twentieth. Only edges that stand upright over many rows are moved, by one pixel, and nothing one
/// pixel wide is covered up.
class EdgeStraightener {
 public:
  void start(int rows, int width_px);
  /// @param unrolled_m row v of the unrolled image, @param warp how it came about; rows in rising order
  void add_row(int v, const float* unrolled_m, const RowWarp& warp);
  /// Moves the edges of the rows added.
  void finish(cv::Mat* unrolled_m);

 private:
  struct Edge {
    float at_px;               ///< where the edge lies, before this row was rounded to whole pixels
    std::int16_t row, column;  ///< of the first pixel right of it
    std::int8_t near_side;     ///< +1 the right side is the nearer, -1 the left
    std::int32_t below;        ///< the same edge in the next row; -1: it ends
    bool begins;               ///< no such edge in the row above
  };
  void straighten(std::int32_t first, cv::Mat* unrolled_m);

  int width_px_ = 0;
  std::vector<std::uint8_t> jump_;
  std::vector<Edge> edges_;
  std::size_t row_above_begin_ = 0, row_above_end_ = 0;
  std::vector<std::int32_t> chain_;
  std::vector<double> sum_, sum_squares_;
};

}  // namespace knav
