#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/depth_profile.h"
#include "core/pose2.h"
#include "core/random.h"
#include "core/range_scan.h"

namespace knav {

/// A hand-made world of line segments, seen without a graph or a simulator.
struct RoomWorld {
  struct Segment {
    double ax, ay, bx, by;
    HeightClass height = HeightClass::kMiddle;
  };
  std::vector<Segment> walls;

  void box(double low_x, double low_y, double high_x, double high_y, HeightClass height = HeightClass::kMiddle) {
    walls.push_back({low_x, low_y, high_x, low_y, height});
    walls.push_back({high_x, low_y, high_x, high_y, height});
    walls.push_back({high_x, high_y, low_x, high_y, height});
    walls.push_back({low_x, high_y, low_x, low_y, height});
  }

  /// 10 m x 7 m with furniture; the robot starts at (0, 0).
  static RoomWorld furnished() {
    RoomWorld world;
    world.box(-4.0, -3.0, 6.0, 4.0);
    world.box(2.5, 2.0, 3.3, 2.6);
    world.box(-2.5, 1.5, -1.9, 3.0);
    world.box(4.2, -2.2, 5.0, -1.0);
    world.box(-1.5, -2.6, -0.7, -2.0);
    return world;
  }

  double range(double x, double y, double angle_rad, HeightClass* height = nullptr) const {
    const double dx = std::cos(angle_rad), dy = std::sin(angle_rad);
    double nearest = std::numeric_limits<double>::infinity();
    for (const Segment& s : walls) {
      const double ex = s.bx - s.ax, ey = s.by - s.ay, determinant = dx * ey - dy * ex;
      if (std::fabs(determinant) < 1e-12) continue;
      const double t = ((s.ax - x) * ey - (s.ay - y) * ex) / determinant;
      const double u = ((s.ax - x) * dy - (s.ay - y) * dx) / determinant;
      if (t <= 1e-6 || u < 0.0 || u > 1.0 || t >= nearest) continue;
      nearest = t;
      if (height) *height = s.height;
    }
    return nearest;
  }

  /// A Kinect's profile with noise growing as the range squared; floor seen free from 1.3 m on; nearer than 0.5 m it is blind.
  DepthProfile profile(const Pose2& T_world_camera, double stamp_s, std::uint64_t seed = 1) const {
    DepthProfile profile;
    profile.stamp_s = stamp_s;
    profile.fx_px = 585.0;
    profile.cx_px = 319.5;
    profile.camera_height_m = 0.5;
    RandomStream random(seed, random_stream::kTest, static_cast<std::uint64_t>(stamp_s * 1e6), 0);
    for (int u = 0; u < 640; ++u) {
      const double right = (u - profile.cx_px) / profile.fx_px;
      const double angle = T_world_camera.yaw_rad - std::atan(right);
      HeightClass height = HeightClass::kMiddle;
      const double z = range(T_world_camera.x_m, T_world_camera.y_m, angle, &height) / std::hypot(1.0, right);
      const double noisy = z + 0.0015 * z * z * random.normal();
      const bool seen = z > 0.5 && z < 20.0;
      profile.z_m.push_back(seen ? static_cast<float>(noisy) : std::numeric_limits<float>::quiet_NaN());
      const bool floor = seen && noisy > 1.5;
      profile.free_from_m.push_back(floor ? 1.3f : std::numeric_limits<float>::quiet_NaN());
      profile.free_to_m.push_back(floor ? static_cast<float>(noisy - 0.1)
                                        : std::numeric_limits<float>::quiet_NaN());
      profile.height_class.push_back(seen ? height : z <= 0.5 ? HeightClass::kBlind : HeightClass::kNone);
    }
    return profile;
  }

  /// A perfect laser scan over fov_rad.
  RangeScan scan(const Pose2& T_world_sensor, double stamp_s, double fov_rad, int rays) const {
    RangeScan scan;
    scan.stamp_s = stamp_s;
    scan.angle_increment_rad = fov_rad / rays;
    scan.angle_min_rad = -0.5 * fov_rad;
    scan.range_max_m = 30.0;
    for (int i = 0; i < rays; ++i) {
      const double angle = T_world_sensor.yaw_rad + scan.angle_min_rad + i * scan.angle_increment_rad;
      scan.range_m.push_back(static_cast<float>(range(T_world_sensor.x_m, T_world_sensor.y_m, angle)));
    }
    return scan;
  }
};

/// A robot that drives a given arc for each step, with odometry that is steadily wrong.
struct DrivenRobot {
  Pose2 T_world_base;
  Pose2 T_odom_base{3.0, -1.0, 0.4};  // odometry's origin is anywhere
  double translation_error = 0.03;    ///< share of the distance
  double rotation_error = 0.05;       ///< share of the turn
  double rotation_per_m_rad = 0.03;

  void drive(double distance_m, double turn_rad) {
    T_world_base = T_world_base * Pose2{distance_m, 0.0, turn_rad};
    T_odom_base = T_odom_base * Pose2{distance_m * (1.0 + translation_error), 0.0,
                                      turn_rad * (1.0 + rotation_error) + rotation_per_m_rad * distance_m};
  }
};

}  // namespace knav
