#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "core/depth_profile.h"
#include "core/pose2.h"
#include "core/random.h"

namespace knav::flat_world {

struct Wall {
  Point2 a, b;
};

inline void add_box(double low_x, double low_y, double high_x, double high_y, std::vector<Wall>* walls) {
  walls->push_back({{low_x, low_y}, {high_x, low_y}});
  walls->push_back({{high_x, low_y}, {high_x, high_y}});
  walls->push_back({{high_x, high_y}, {low_x, high_y}});
  walls->push_back({{low_x, high_y}, {low_x, low_y}});
}

/// A ring of corridors, 3 m wide, round a block of 8 x 4 m, with cupboards of different sizes: no place looks
/// like another. The drive starts at (0, 0).
inline std::vector<Wall> ring() {
  std::vector<Wall> walls;
  add_box(-1.5, -1.5, 12.5, 8.5, &walls);
  add_box(1.5, 1.5, 9.5, 5.5, &walls);
  add_box(3.0, -1.5, 4.2, -1.0, &walls);
  add_box(7.0, 1.0, 7.5, 1.5, &walls);
  add_box(12.0, 2.0, 12.5, 3.5, &walls);
  add_box(8.0, 8.0, 8.6, 8.5, &walls);
  add_box(4.0, 5.5, 5.5, 5.8, &walls);
  add_box(-1.5, 3.0, -1.1, 3.3, &walls);
  return walls;
}

/// Range along a ray, +Inf if nothing is hit.
inline double cast(const std::vector<Wall>& walls, double x, double y, double dir_x, double dir_y) {
  double best = std::numeric_limits<double>::infinity();
  for (const Wall& w : walls) {
    const double ex = w.b.x_m - w.a.x_m, ey = w.b.y_m - w.a.y_m;
    const double det = dir_x * ey - dir_y * ex;
    if (std::fabs(det) < 1e-12) continue;
    const double ax = w.a.x_m - x, ay = w.a.y_m - y;
    const double r = (ax * ey - ay * ex) / det, s = (ax * dir_y - ay * dir_x) / det;
    if (r > 0.0 && s >= 0.0 && s <= 1.0) best = std::min(best, r);
  }
  return best;
}

inline double distance_to_walls(const std::vector<Wall>& walls, double x, double y) {
  double best = 1e300;
  for (const Wall& w : walls) {
    const double ex = w.b.x_m - w.a.x_m, ey = w.b.y_m - w.a.y_m;
    const double t = std::clamp(((x - w.a.x_m) * ex + (y - w.a.y_m) * ey) / (ex * ex + ey * ey), 0.0, 1.0);
    best = std::min(best, std::hypot(x - w.a.x_m - t * ex, y - w.a.y_m - t * ey));
  }
  return best;
}

/// A profile of 160 columns over 57 degrees with a Kinect's growth of noise (sd 0.0015 r^2), 0.5 to 10 m.
inline DepthProfile profile_at(const std::vector<Wall>& walls, const Pose2& T_world_camera, double stamp_s,
                               RandomStream& random) {
  DepthProfile p;
  p.stamp_s = stamp_s;
  p.fx_px = 146.25;
  p.cx_px = 79.5;
  p.camera_height_m = 0.5;
  p.range_max_m = 10.0;
  const double c = std::cos(T_world_camera.yaw_rad), s = std::sin(T_world_camera.yaw_rad);
  for (int u = 0; u < 160; ++u) {
    const double right = (u - p.cx_px) / p.fx_px, stretch = std::hypot(1.0, right);
    const double dir_x = (c + s * right) / stretch, dir_y = (s - c * right) / stretch;
    const double z = cast(walls, T_world_camera.x_m, T_world_camera.y_m, dir_x, dir_y) / stretch;
    const bool seen = z >= 0.5 && z <= 10.0;
    const auto noisy = static_cast<float>(z + random.normal(0.0, 0.0015 * z * z));
    p.z_m.push_back(seen ? noisy : std::numeric_limits<float>::quiet_NaN());
    p.free_from_m.push_back(0.3f);
    p.free_to_m.push_back(seen ? noisy : std::min(10.0f, static_cast<float>(z)));
    p.height_class.push_back(seen ? HeightClass::kMiddle : HeightClass::kNone);
  }
  return p;
}

/// Drives through the points, turning on the spot at each; 0.5 m/s and 0.8 rad/s, 10 poses a second.
inline std::vector<Pose2> drive_through(const std::vector<Point2>& points) {
  constexpr double kPeriod_s = 0.1;
  std::vector<Pose2> poses = {{points[0].x_m, points[0].y_m, 0.0}};
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Pose2 from = poses.back();
    const double yaw = std::atan2(points[i].y_m - from.y_m, points[i].x_m - from.x_m);
    const double turn = normalize_angle_rad(yaw - from.yaw_rad);
    const int turns = static_cast<int>(std::ceil(std::fabs(turn) / (0.8 * kPeriod_s)));
    for (int k = 1; k <= turns; ++k) poses.push_back({from.x_m, from.y_m, from.yaw_rad + turn * k / turns});
    const double length = std::hypot(points[i].x_m - from.x_m, points[i].y_m - from.y_m);
    const int steps = static_cast<int>(std::ceil(length / (0.5 * kPeriod_s)));
    for (int k = 1; k <= steps; ++k) {
      poses.push_back({from.x_m + length * k / steps * std::cos(yaw),
                       from.y_m + length * k / steps * std::sin(yaw), yaw});
    }
  }
  return poses;
}

/// Odometry that drifts: every metre reads 1 % long and turns by 1 deg that were not driven.
inline std::vector<Pose2> drifting_odometry(const std::vector<Pose2>& truth) {
  std::vector<Pose2> odometry = {{5.0, -3.0, 1.0}};  // its origin is anywhere
  for (std::size_t i = 1; i < truth.size(); ++i) {
    Pose2 step = truth[i - 1].inverse() * truth[i];
    const double length = std::hypot(step.x_m, step.y_m);
    step.x_m *= 1.01;
    step.yaw_rad += 0.0175 * length;
    odometry.push_back(odometry.back() * step);
  }
  return odometry;
}

}  // namespace knav::flat_world
