#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "brin_benchmark/benchmark_report.h"
#include "core/error.h"
#include "core/file_io.h"

namespace knav {

void write_run_picture(const std::string& path, const MapDirectory& map,
                       const std::vector<Waypoint>& waypoints, const RunRecord& record) {
  const GridGeometry& g = map.occupancy.geometry;
  cv::Mat picture(g.height_cells, g.width_cells, CV_8UC3);
  for (int iy = 0; iy < g.height_cells; ++iy) {
    for (int ix = 0; ix < g.width_cells; ++ix) {
      const int value = map.occupancy.value[g.index(ix, iy)];
      const cv::Vec3b color = value < 0     ? cv::Vec3b(190, 190, 190)
                              : value >= 65 ? cv::Vec3b(0, 0, 0)
                                            : cv::Vec3b(255, 255, 255);
      picture.at<cv::Vec3b>(g.height_cells - 1 - iy, ix) = color;
    }
  }
  constexpr int kShift = 4;  // sub-pixel positions
  const auto pixel = [&](double x_m, double y_m) {
    const double u = (x_m - g.origin_x_m) / g.resolution_m - 0.5;
    const double v = g.height_cells - 0.5 - (y_m - g.origin_y_m) / g.resolution_m;
    return cv::Point(static_cast<int>(std::lround(u * (1 << kShift))),
                     static_cast<int>(std::lround(v * (1 << kShift))));
  };
  // Truth is known in the world; a waypoint is known in both.
  const Pose2 T_map_world =
      waypoints.empty() ? Pose2{} : waypoints.front().T_map_robot * waypoints.front().T_world_robot.inverse();
  const auto draw = [&](const Trajectory& trajectory, const Pose2& T_map, const cv::Scalar& color,
                        int thickness) {
    for (std::size_t i = 1; i < trajectory.size(); ++i) {
      const Pose2 a = T_map * trajectory[i - 1].T_map_robot, b = T_map * trajectory[i].T_map_robot;
      if (distance_m(a, b) > 0.5) continue;  // set down elsewhere
      cv::line(picture, pixel(a.x_m, a.y_m), pixel(b.x_m, b.y_m), color, thickness, cv::LINE_AA, kShift);
    }
  };
  draw(record.truth, T_map_world, {60, 160, 40}, 3);
  draw(record.estimate, {}, {40, 40, 220}, 1);
  for (const Waypoint& waypoint : waypoints) {
    cv::circle(picture, pixel(waypoint.T_map_robot.x_m, waypoint.T_map_robot.y_m), 6 << kShift, {200, 80, 0},
               2, cv::LINE_AA, kShift);
  }
  for (const Point2& at : record.failed_at) {
    const Point2 p = T_map_world * at;
    const cv::Point c = pixel(p.x_m, p.y_m);
    const int arm = 10 << kShift;
    cv::line(picture, c - cv::Point(arm, arm), c + cv::Point(arm, arm), {0, 0, 255}, 3, cv::LINE_AA, kShift);
    cv::line(picture, c - cv::Point(arm, -arm), c + cv::Point(arm, -arm), {0, 0, 255}, 3, cv::LINE_AA,
             kShift);
  }
  std::vector<unsigned char> png;
  if (!cv::imencode(".png", picture, png)) throw UserError(path + ": the picture cannot be encoded.");
  write_text_atomically(path, std::string(png.begin(), png.end()));
}

}  // namespace knav
