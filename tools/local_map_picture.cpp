#include "tools/local_map_picture.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/file_io.h"
#include "tsdf_local_mapper/local_mapper.h"

namespace knav {
namespace {

constexpr int kPixelsPerCell = 2;

void write_png(const std::filesystem::path& path, const cv::Mat& image) {
  write_file_atomically(path.string(), [&](const std::string& beside) {
    if (!cv::imwrite(beside, image)) throw UserError(path.string() + ": cannot be written.");
  });
}

/// Blue, green, red of a signed distance: white at the surface, red in front, blue behind.
cv::Vec3b color_of(float distance) {
  if (std::isnan(distance)) return {110, 110, 110};
  const auto fade = static_cast<std::uint8_t>(255.0f * (1.0f - std::min(1.0f, std::fabs(distance))));
  return distance >= 0.0f ? cv::Vec3b(fade, fade, 255) : cv::Vec3b(255, fade, fade);
}

cv::Mat tsdf_image(const TsdfGrid& grid) {
  int x0 = grid.first_x() + grid.size_cells(), x1 = grid.first_x(), y0 = grid.first_y() + grid.size_cells(),
      y1 = grid.first_y();
  for (int y = grid.first_y(); y < grid.first_y() + grid.size_cells(); ++y) {
    for (int x = grid.first_x(); x < grid.first_x() + grid.size_cells(); ++x) {
      if (!grid.known(x, y)) continue;
      x0 = std::min(x0, x);
      x1 = std::max(x1, x);
      y0 = std::min(y0, y);
      y1 = std::max(y1, y);
    }
  }
  if (x0 > x1) return cv::Mat(1, 1, CV_8UC3, cv::Scalar::all(110));
  cv::Mat image(y1 - y0 + 1, x1 - x0 + 1, CV_8UC3);
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      image.at<cv::Vec3b>(y1 - y, x - x0) =
          color_of(grid.known(x, y) ? grid.distance(x, y) : std::numeric_limits<float>::quiet_NaN());
    }
  }
  cv::resize(image, image, cv::Size(), kPixelsPerCell, kPixelsPerCell, cv::INTER_NEAREST);
  return image;
}

cv::Mat occupancy_image(const OccupancyGrid& grid) {
  const GridGeometry& g = grid.geometry;
  cv::Mat image(g.height_cells, g.width_cells, CV_8UC3);
  for (int y = 0; y < g.height_cells; ++y) {
    for (int x = 0; x < g.width_cells; ++x) {
      const int value = grid.value[g.index(x, y)];
      const auto shade = static_cast<std::uint8_t>(value < 0 ? 150 : 255 - value * 255 / 100);
      image.at<cv::Vec3b>(g.height_cells - 1 - y, x) = {shade, shade, shade};
    }
  }
  cv::resize(image, image, cv::Size(), kPixelsPerCell, kPixelsPerCell, cv::INTER_NEAREST);
  return image;
}

void draw_scan(const RangeScan& scan, const Pose2& T_local_base, const GridGeometry& g, cv::Mat* image) {
  const auto pixel = [&](const Point2& p) {
    return cv::Point(static_cast<int>((p.x_m - g.origin_x_m) / g.resolution_m * kPixelsPerCell),
                     image->rows - 1 - static_cast<int>((p.y_m - g.origin_y_m) / g.resolution_m * kPixelsPerCell));
  };
  for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
    const double range_m = scan.range_m[i];
    if (!std::isfinite(range_m)) continue;
    const double angle_rad = scan.angle_min_rad + static_cast<double>(i) * scan.angle_increment_rad;
    const double evidence = i < scan.evidence.size() ? scan.evidence[i] : 1.0;
    const cv::Scalar color(0, 90 + 110 * evidence, 230 * (1.0 - evidence));
    cv::circle(*image, pixel(T_local_base * Point2{range_m * std::cos(angle_rad), range_m * std::sin(angle_rad)}), 1,
               color, cv::FILLED);
  }
  cv::arrowedLine(*image, pixel({T_local_base.x_m, T_local_base.y_m}), pixel(T_local_base * Point2{0.8, 0.0}),
                  cv::Scalar(200, 0, 0), 2, cv::LINE_AA, 0, 0.4);
}

}  // namespace

void write_local_map_pictures(const std::string& folder, const LocalMapper& mapper) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) throw UserError(folder + ": cannot be made: " + failed.message() + ".");
  const std::filesystem::path out(folder);
  write_png(out / "tsdf.png", tsdf_image(mapper.grid()));
  OccupancyGrid occupancy;
  mapper.extract_local_map(&occupancy);
  cv::Mat image = occupancy_image(occupancy);
  write_png(out / "local_map.png", image);
  RangeScan scan;
  mapper.extract_scan_360(&scan);
  draw_scan(scan, mapper.result().T_local_base, occupancy.geometry, &image);
  write_png(out / "scan_360.png", image);
}

}  // namespace knav
