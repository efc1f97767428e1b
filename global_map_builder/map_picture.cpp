#include "global_map_builder/map_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"

namespace knav {
namespace {

constexpr int kShift = 4;  // sub-pixel bits of OpenCV's drawing

/// Map to pixels: an even zoom so that the longer side has about 1600 pixels.
struct Canvas {
  explicit Canvas(const OccupancyGrid& grid) : geometry(grid.geometry) {
    const int longer = std::max(geometry.width_cells, geometry.height_cells);
    zoom = longer <= 1600 ? std::clamp(1600 / std::max(1, longer), 1, 6) : 1600.0 / longer;
    cv::Mat cells(geometry.height_cells, geometry.width_cells, CV_8UC3);
    for (int row = 0; row < cells.rows; ++row) {
      for (int column = 0; column < cells.cols; ++column) {
        const int value = grid.value[geometry.index(column, cells.rows - 1 - row)];
        const int gray = value < 0 ? 190 : value > 50 ? 0 : 255;
        cells.at<cv::Vec3b>(row, column) = cv::Vec3b::all(static_cast<unsigned char>(gray));
      }
    }
    cv::resize(cells, image, {}, zoom, zoom, zoom < 1.0 ? cv::INTER_AREA : cv::INTER_NEAREST);
  }

  cv::Point at(const Pose2& p) const {
    const double scale = zoom / geometry.resolution_m * (1 << kShift);
    return {static_cast<int>((p.x_m - geometry.origin_x_m) * scale),
            static_cast<int>((geometry.origin_y_m + geometry.height_cells * geometry.resolution_m - p.y_m) *
                             scale)};
  }
  void line(const Pose2& a, const Pose2& b, const cv::Scalar& color, int width) {
    cv::line(image, at(a), at(b), color, width, cv::LINE_AA, kShift);
  }
  void scale_bar() {
    const double width_m = geometry.width_cells * geometry.resolution_m;
    const double length_m = std::max(1.0, std::pow(10.0, std::floor(std::log10(width_m / 4.0))));
    const int pixels = static_cast<int>(length_m / geometry.resolution_m * zoom);
    const cv::Point left(12, image.rows - 12);
    cv::line(image, left, left + cv::Point(pixels, 0), {0, 0, 0}, 3);
    cv::putText(image, fmt::format("{:.0f} m", length_m), left + cv::Point(0, -8), cv::FONT_HERSHEY_SIMPLEX,
                0.5, {0, 0, 0}, 1, cv::LINE_AA);
  }
  void write(const std::string& path) const {
    if (!cv::imwrite(path, image)) throw UserError(path + ": cannot be written; is the disk full?");
  }

  std::vector<unsigned char> png() const {
    std::vector<unsigned char> bytes;
    cv::imencode(".png", image, bytes, {cv::IMWRITE_PNG_COMPRESSION, 9});
    return bytes;
  }
  void drive(const Trajectory& drive) {
    for (std::size_t i = 1; i < drive.size(); ++i) {
      const double t = static_cast<double>(i) / static_cast<double>(drive.size());
      line(drive[i - 1].T_map_robot, drive[i].T_map_robot, {255 * (1 - t), 60, 255 * t}, 2);
    }
  }

  GridGeometry geometry;
  double zoom = 1.0;
  cv::Mat image;
};

Canvas draw(const BuiltMap& built) {
  Canvas canvas(built.map.occupancy);
  canvas.drive(built.map.trajectory);
  for (const Closure& c : built.record.closures) {
    const Pose2& from = built.record.T_map_keyframe[static_cast<std::size_t>(c.from)];
    const Pose2& to = built.record.T_map_keyframe[static_cast<std::size_t>(c.to)];
    const cv::Scalar color = c.accepted ? cv::Scalar(0, 160, 0) : cv::Scalar(255, 0, 255);
    canvas.line(from, to, color, 1);
    cv::circle(canvas.image, canvas.at(to), 3 << kShift, color, c.source == "button" ? cv::FILLED : 1,
               cv::LINE_AA, kShift);
  }
  canvas.scale_bar();
  return canvas;
}

}  // namespace

void write_map_picture(const std::string& path, const BuiltMap& built) { draw(built).write(path); }

std::vector<unsigned char> map_picture(const BuiltMap& built) { return draw(built).png(); }

std::vector<unsigned char> before_picture(const BuiltMap& built) {
  Canvas canvas(built.before);
  std::size_t first = 0;
  for (const Drive& drive : built.record.drives) {
    // Each drive where it begins in the map.
    const Pose2 T_map_drive =
        built.record.T_map_keyframe[first] * drive.keyframes.front().T_drive_base.inverse();
    first += drive.keyframes.size();
    Trajectory poses = drive.trajectory;
    for (StampedPose2& pose : poses) pose.T_map_robot = T_map_drive * pose.T_map_robot;
    canvas.drive(poses);
  }
  canvas.scale_bar();
  return canvas.png();
}

std::vector<unsigned char> changes_picture(const BuiltMap& built) {
  Canvas canvas(built.map.occupancy);
  for (const MapChange& change : built.changes) {
    constexpr double kMargin_m = 0.15;
    const double w = 0.5 * change.width_m + kMargin_m, h = 0.5 * change.height_m + kMargin_m;
    const cv::Scalar color = change.occupied ? cv::Scalar(0, 0, 230) : cv::Scalar(230, 80, 0);
    const Pose2 corners[] = {{change.x_m - w, change.y_m - h, 0},
                             {change.x_m + w, change.y_m - h, 0},
                             {change.x_m + w, change.y_m + h, 0},
                             {change.x_m - w, change.y_m + h, 0}};
    for (int i = 0; i < 4; ++i) canvas.line(corners[i], corners[(i + 1) % 4], color, 2);
  }
  canvas.scale_bar();
  return canvas.png();
}

std::vector<unsigned char> closure_thumbnail(const Closure& closure) {
  constexpr int kSide = 180;
  cv::Mat image(kSide, kSide, CV_8UC3, cv::Scalar::all(255));
  const Pose2& T = closure.match.T_from_to;
  std::vector<Point2> later;
  for (const SurfacePoint& p : closure.to_points) later.push_back(T * Point2{p.x_m, p.y_m});
  double low_x = 1e300, low_y = 1e300, high_x = -1e300, high_y = -1e300;
  const auto cover = [&](double x, double y) {
    low_x = std::min(low_x, x), high_x = std::max(high_x, x);
    low_y = std::min(low_y, y), high_y = std::max(high_y, y);
  };
  for (const SurfacePoint& p : closure.from_points) cover(p.x_m, p.y_m);
  for (const Point2& p : later) cover(p.x_m, p.y_m);
  const double scale = (kSide - 8) / std::max({high_x - low_x, high_y - low_y, 1.0});
  const auto dot = [&](double x, double y, const cv::Scalar& color) {
    const cv::Point at(static_cast<int>(4 + (x - low_x) * scale),
                       static_cast<int>(kSide - 4 - (y - low_y) * scale));
    cv::rectangle(image, at, at + cv::Point(1, 1), color, cv::FILLED);
  };
  for (const SurfacePoint& p : closure.from_points) dot(p.x_m, p.y_m, {0, 0, 0});
  for (const Point2& p : later) dot(p.x_m, p.y_m, {0, 0, 230});
  std::vector<unsigned char> bytes;
  cv::imencode(".png", image, bytes, {cv::IMWRITE_PNG_COMPRESSION, 9});
  return bytes;
}

void write_map_picture(const std::string& path, const MapDirectory& map) {
  Canvas canvas(map.occupancy);
  canvas.scale_bar();
  canvas.write(path);
}

}  // namespace knav
