#include "kinect_calib/wall_tiles.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "kinect_calib/kinect_noise.h"
#include "kinect_calib/wall_plane.h"

namespace knav {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kNear =
    5.0 * kInverseDepthPerCode;  // further off the tile's middle: something else, or an outlier

}  // namespace

double median_of(std::vector<double>* values) {
  const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

TileGrid::TileGrid(const PinholeModel& camera, int side_px)
    : columns((camera.width_px + side_px - 1) / side_px),
      rows((camera.height_px + side_px - 1) / side_px),
      tile_px(side_px) {
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      x.push_back(((c + 0.5) * side_px - 0.5 - camera.cx_px) / camera.fx_px);
      y.push_back(((r + 0.5) * side_px - 0.5 - camera.cy_px) / camera.fy_px);
    }
  }
}

const std::vector<double>& WallTiles::average_gate_tiles(const cv::Mat& frame) {
  per_m_.assign(grid_.count(), kNaN);
  std::vector<double> values;
  for (int r = 0; r < grid_.rows; ++r) {
    for (int c = 0; c < grid_.columns; ++c) {
      values.clear();
      double half_sum[2] = {0.0, 0.0}, half_count[2] = {0.0, 0.0};
      for (int v = r * kGateTile_px; v < std::min(frame.rows, (r + 1) * kGateTile_px); ++v) {
        const int half = 2 * (v - r * kGateTile_px) < kGateTile_px ? 0 : 1;
        const float* row = frame.ptr<float>(v);
        for (int u = c * kGateTile_px; u < std::min(frame.cols, (c + 1) * kGateTile_px); ++u) {
          if (!(row[u] > 0.0f)) continue;
          values.push_back(1.0 / row[u]);
          half_sum[half] += 1.0 / row[u];
          half_count[half] += 1.0;
        }
      }
      if (values.size() < static_cast<std::size_t>(kGateTile_px * kGateTile_px) / 4 + 1) continue;
      // Floor comes nearer by a code or more with every row; a wall 7 degrees off square, by 0.15, and the
      // sensor's own error in the corners adds 0.1 at 1 m, more the nearer the wall.
      if (half_count[0] > 0.0 && half_count[1] > 0.0) {
        const double upper = half_sum[0] / half_count[0], lower = half_sum[1] / half_count[1];
        const double most_codes = kGateTile_px * (0.15 + 0.1 * std::min(upper, lower));
        if (std::abs(upper - lower) > most_codes * kInverseDepthPerCode) continue;
      }
      // The mean near the median: a median alone would be rounded to a whole code.
      const double median = median_of(&values);
      double sum = 0.0, near = 0.0;
      for (const double value : values) {
        if (std::abs(value - median) > kNear) continue;
        sum += value;
        near += 1.0;
      }
      per_m_[grid_.index(r, c)] = sum / near;
    }
  }
  return per_m_;
}

void WallTiles::find(const cv::Mat& frame, double distance_m) {
  average_gate_tiles(frame);
  WallPlane plane{1.0 / distance_m};
  const int enough = static_cast<int>(grid_.count()) * 2 / 5;
  const int kept = fit_wall_plane(grid_, per_m_, enough, &plane);
  if (kept < enough) {
    throw UserError(
        fmt::format("the frame said to be {:.2f} m from a wall shows one in {} of {} tiles; the wall must "
                    "fill most of the view, at that distance.",
                    distance_m, kept, grid_.count()));
  }
  if (plane.tilt() > kMostTilt) {
    throw UserError(
        fmt::format("the frame {:.2f} m from a wall is {:.0f} degrees off square; at most 7 will do.",
                    distance_m, std::atan(plane.tilt()) * 180.0 / M_PI));
  }
  for (std::size_t tile = 0; tile < grid_.count(); ++tile) {
    const double expected = plane.at(grid_.x[tile], grid_.y[tile]);
    if (!(std::abs(per_m_[tile] - expected) <= wall_tolerance_per_m(kWallShare, expected)))
      per_m_[tile] = kNaN;
  }
}

void WallTiles::average(const cv::Mat& frame, const TileGrid& grid, std::vector<double>* per_m) const {
  std::vector<double> sum(grid.count(), 0.0), count(grid.count(), 0.0);
  for (int v = 0; v < frame.rows; ++v) {
    const float* row = frame.ptr<float>(v);
    for (int u = 0; u < frame.cols; ++u) {
      const double middle = per_m_[grid_.index(v / kGateTile_px, u / kGateTile_px)];
      const double value = 1.0 / row[u];
      if (!(row[u] > 0.0f && std::abs(value - middle) <= kNear)) continue;
      const std::size_t tile = grid.index(v / grid.tile_px, u / grid.tile_px);
      sum[tile] += value;
      count[tile] += 1.0;
    }
  }
  per_m->resize(grid.count());
  for (int r = 0; r < grid.rows; ++r) {
    for (int c = 0; c < grid.columns; ++c) {
      const std::size_t tile = grid.index(r, c);
      const int height = std::min(grid.tile_px, frame.rows - r * grid.tile_px);
      const int width = std::min(grid.tile_px, frame.cols - c * grid.tile_px);
      (*per_m)[tile] = count[tile] > 0.25 * height * width ? sum[tile] / count[tile] : kNaN;
    }
  }
}

}  // namespace knav
