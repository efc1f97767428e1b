#include "kinect_calib/wall_viewer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/pose2.h"

namespace knav {
namespace {

// Shares of the image. Further to the sides the sensor's error is largest. Below there is floor when the wall
// is 4 m off; the same pixels judge all distances, or the device's slant would seem to change with it.
constexpr double kMiddleColumns[2] = {0.2, 0.8}, kMiddleRows[2] = {0.1, 0.6};
constexpr double kLeastOnWall = 0.5;
// A leg at 3 m is 3 % of the middle; a wall's foot or a socket is less.
constexpr double kMostOffWall = 0.02;
constexpr double kMostTurned_deg = 20.0;
constexpr double kMostPitched_deg = 5.0;  // the fit takes 7 degrees to any side
// Farther off what is above the middle of the device's ring looks like pitch.
constexpr double kPitchTold_m = 0.8;

}  // namespace

WallViewer::WallViewer(const PinholeModel& camera) : tiles_(camera) {
  const TileGrid& grid = tiles_.gate_grid();
  for (int r = 0; r < grid.rows; ++r) {
    for (int c = 0; c < grid.columns; ++c) {
      const double across = (c + 0.5) / grid.columns, down = (r + 0.5) / grid.rows;
      const bool middle = across > kMiddleColumns[0] && across < kMiddleColumns[1] && down > kMiddleRows[0] &&
                          down < kMiddleRows[1];
      in_middle_.push_back(middle ? 1 : 0);
      middle_count_ += middle ? 1 : 0;
    }
  }
}

bool WallViewer::is_on_wall(std::size_t tile) const {
  const double expected = view_.plane.at(tiles_.gate_grid().x[tile], tiles_.gate_grid().y[tile]);
  return std::abs(middle_per_m_[tile] - expected) <= wall_tolerance_per_m(kWallShare, expected);
}

/// The floor before the wall fills rows from below. Where it drops out in a tile's upper half it does not
/// show by its slope.
int WallViewer::first_floor_row() const {
  const TileGrid& grid = tiles_.gate_grid();
  for (int r = grid.rows - 1; r > grid.rows / 2; --r) {
    int middle = 0, on = 0;
    for (int c = 0; c < grid.columns; ++c) {
      const std::size_t tile = grid.index(r, c);
      middle += in_middle_[tile] != 0 ? 1 : 0;
      on += in_middle_[tile] != 0 && is_on_wall(tile) ? 1 : 0;
    }
    if (middle > 0 && 2 * on >= middle) return r + 1;
  }
  return grid.rows / 2 + 1;
}

const SeenWall& WallViewer::look(const cv::Mat& depth_m) {
  view_ = SeenWall{};
  const TileGrid& grid = tiles_.gate_grid();
  const std::vector<double>& per_m = tiles_.average_gate_tiles(depth_m);
  middle_per_m_.assign(per_m.size(), std::numeric_limits<double>::quiet_NaN());
  values_.clear();
  for (std::size_t tile = 0; tile < per_m.size(); ++tile) {
    if (in_middle_[tile] == 0 || std::isnan(per_m[tile])) continue;
    middle_per_m_[tile] = per_m[tile];
    values_.push_back(per_m[tile]);
  }
  const int answered = static_cast<int>(values_.size());
  const int enough = static_cast<int>(kLeastOnWall * middle_count_);
  if (answered < enough) {
    view_.fault = fmt::format(
        "only {:.0f} % of the image's middle has depth; the Kinect sees nothing nearer than 0.5 m: is the "
        "wall there, light and matt?",
        100.0 * answered / middle_count_);
    return view_;
  }
  view_.plane = WallPlane{median_of(&values_)};
  const int kept = fit_wall_plane(grid, middle_per_m_, enough, &view_.plane);
  view_.on_wall = static_cast<double>(kept) / middle_count_;
  const int floor_row = first_floor_row();
  int off = 0, on = 0;
  double squares = 0.0;
  for (std::size_t tile = 0; tile < grid.index(floor_row, 0); ++tile) {
    if (std::isnan(middle_per_m_[tile])) continue;
    if (is_on_wall(tile)) {
      const double deviation = middle_per_m_[tile] - view_.plane.at(grid.x[tile], grid.y[tile]);
      ++on;
      squares += deviation * deviation;
    } else {
      ++off;
    }
  }
  view_.off_wall = static_cast<double>(off) / std::max(1, on + off);
  view_.deviation_codes = on > 0 ? std::sqrt(squares / on) / kInverseDepthPerCode : 0.0;
  const double yaw_deg = view_.plane.yaw_rad() * 180.0 / kPi,
               pitch_deg = view_.plane.pitch_rad() * 180.0 / kPi;
  if (kept < enough || view_.off_wall > kMostOffWall) {
    view_.fault = fmt::format(
        "the image's middle is no plane ({:.0f} % of it lies off the wall): has somebody walked in, or does "
        "the wall not fill the view?",
        100.0 * (kept < enough ? 1.0 - view_.on_wall : view_.off_wall));
  } else if (std::abs(yaw_deg) > kMostTurned_deg) {
    view_.fault = fmt::format("the wall stands {:.0f} degrees off square; turn the robot to within {:.0f}.",
                              std::abs(yaw_deg), kMostTurned_deg);
  } else if (std::abs(pitch_deg) > kMostPitched_deg && view_.plane.distance_m() < kPitchTold_m) {
    view_.fault = fmt::format("the camera looks {:.1f} degrees {}; level it to within {:.0f}.",
                              std::abs(pitch_deg), pitch_deg > 0.0 ? "up" : "down", kMostPitched_deg);
  }
  return view_;
}

}  // namespace knav
