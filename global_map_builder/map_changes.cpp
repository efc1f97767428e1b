#include "global_map_builder/map_changes.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace knav {
namespace {

enum : std::uint8_t { kUnknown = 0, kFree = 1, kOccupied = 2 };

/// `grid` on the lattice of `like`.
cv::Mat states(const OccupancyGrid& grid, const GridGeometry& like) {
  const GridGeometry& g = grid.geometry;
  cv::Mat out(like.height_cells, like.width_cells, CV_8UC1, cv::Scalar(kUnknown));
  for (int iy = 0; iy < like.height_cells; ++iy) {
    for (int ix = 0; ix < like.width_cells; ++ix) {
      const int x = g.cell_x(like.center_x_m(ix)), y = g.cell_y(like.center_y_m(iy));
      if (!g.contains(x, y)) continue;
      const int value = grid.value[g.index(x, y)];
      if (value >= 0) out.at<std::uint8_t>(iy, ix) = value >= 50 ? kOccupied : kFree;
    }
  }
  return out;
}

cv::Mat disc(int radius_cells) {
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius_cells + 1, 2 * radius_cells + 1});
}

/// Surface cells of `has` round which, within the tolerance, `lacks` is free and nothing else.
cv::Mat missing(const cv::Mat& has, const cv::Mat& lacks, int radius_cells) {
  cv::Mat other;  // occupied or unknown nearby
  cv::dilate(lacks != kFree, other, disc(radius_cells));
  return (has == kOccupied) & ~other;
}

void collect(const cv::Mat& cells, bool occupied, const GridGeometry& g, double tolerance_m, double least_m,
             std::vector<MapChange>* changes) {
  cv::Mat joined, labels, stats, centers;
  cv::dilate(cells, joined, disc(std::max(1, static_cast<int>(std::lround(tolerance_m / g.resolution_m)))));
  const int count = cv::connectedComponents(joined, labels);
  std::vector<cv::Rect> box(static_cast<std::size_t>(count));
  std::vector<double> length(static_cast<std::size_t>(count));
  for (int iy = 0; iy < cells.rows; ++iy) {
    for (int ix = 0; ix < cells.cols; ++ix) {
      if (cells.at<std::uint8_t>(iy, ix) == 0) continue;
      const auto k = static_cast<std::size_t>(labels.at<int>(iy, ix));
      box[k] |= cv::Rect(ix, iy, 1, 1);
      length[k] += g.resolution_m;
    }
  }
  for (std::size_t k = 1; k < box.size(); ++k) {
    if (length[k] < least_m) continue;
    MapChange change;
    change.occupied = occupied;
    change.width_m = box[k].width * g.resolution_m;
    change.height_m = box[k].height * g.resolution_m;
    change.x_m = g.origin_x_m + box[k].x * g.resolution_m + 0.5 * change.width_m;
    change.y_m = g.origin_y_m + box[k].y * g.resolution_m + 0.5 * change.height_m;
    change.wall_m = length[k];
    changes->push_back(change);
  }
}

}  // namespace

std::vector<MapChange> find_changes(const OccupancyGrid& before, const OccupancyGrid& now, double tolerance_m,
                                    double least_m) {
  const GridGeometry& g = now.geometry;
  const cv::Mat old_state = states(before, g), new_state = states(now, g);
  const int radius = std::max(1, static_cast<int>(std::lround(tolerance_m / g.resolution_m)));
  std::vector<MapChange> changes;
  collect(missing(new_state, old_state, radius), true, g, tolerance_m, least_m, &changes);
  collect(missing(old_state, new_state, radius), false, g, tolerance_m, least_m, &changes);
  std::stable_sort(changes.begin(), changes.end(),
                   [](const MapChange& a, const MapChange& b) { return a.wall_m > b.wall_m; });
  return changes;
}

}  // namespace knav
