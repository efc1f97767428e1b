#pragma once

#include <cmath>

namespace knav {

constexpr double kPi = 3.14159265358979323846;

/// The same angle in (-pi, pi].
inline double normalize_angle_rad(double angle_rad) {
  const double wrapped = std::remainder(angle_rad, 2.0 * kPi);
  return wrapped <= -kPi ? wrapped + 2.0 * kPi : wrapped;
}

struct Point2 {
  double x_m = 0.0;
  double y_m = 0.0;
};

/// A rigid transform of the plane. T_a_b maps points given in frame b into frame a, and is the pose of b in a.
struct Pose2 {
  double x_m = 0.0;
  double y_m = 0.0;
  double yaw_rad = 0.0;

  Pose2 inverse() const {
    const double c = std::cos(yaw_rad), s = std::sin(yaw_rad);
    return {-c * x_m - s * y_m, s * x_m - c * y_m, normalize_angle_rad(-yaw_rad)};
  }
};

inline Pose2 operator*(const Pose2& T_a_b, const Pose2& T_b_c) {
  const double c = std::cos(T_a_b.yaw_rad), s = std::sin(T_a_b.yaw_rad);
  return {T_a_b.x_m + c * T_b_c.x_m - s * T_b_c.y_m, T_a_b.y_m + s * T_b_c.x_m + c * T_b_c.y_m,
          normalize_angle_rad(T_a_b.yaw_rad + T_b_c.yaw_rad)};
}

inline Point2 operator*(const Pose2& T_a_b, const Point2& p_b) {
  const double c = std::cos(T_a_b.yaw_rad), s = std::sin(T_a_b.yaw_rad);
  return {T_a_b.x_m + c * p_b.x_m - s * p_b.y_m, T_a_b.y_m + s * p_b.x_m + c * p_b.y_m};
}

inline double distance_m(const Pose2& a, const Pose2& b) { return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m); }

inline bool is_finite(const Pose2& p) {
  return std::isfinite(p.x_m) && std::isfinite(p.y_m) && std::isfinite(p.yaw_rad);
}

/// The pose a fraction t of the way from a to b (t in [0, 1]), turning the short way round.
inline Pose2 interpolate(const Pose2& a, const Pose2& b, double t) {
  return {a.x_m + t * (b.x_m - a.x_m), a.y_m + t * (b.y_m - a.y_m),
          normalize_angle_rad(a.yaw_rad + t * normalize_angle_rad(b.yaw_rad - a.yaw_rad))};
}

}  // namespace knav
