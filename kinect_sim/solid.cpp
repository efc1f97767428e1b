#include "kinect_sim/solid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace knav {

double albedo(Material material) {
  switch (material) {
    case Material::kWall:
      return 0.65;
    case Material::kFloor:
      return 0.45;
    case Material::kCeiling:
      return 0.70;
    case Material::kWood:
      return 0.45;
    case Material::kFabric:
      return 0.35;
    case Material::kMetal:
      return 0.20;
    case Material::kDark:
      return 0.04;
    case Material::kPerson:
      return 0.40;
    case Material::kPaper:
      return 0.80;
    case Material::kInk:
      return 0.15;
    case Material::kGlass:
    case Material::kSun:
      return 0.0;
  }
  return 0.0;
}

Solid make_box(const Pose2& T_world_center, double length_m, double width_m, double bottom_m, double top_m,
               Material material) {
  Solid box;
  const double x = length_m / 2, y = width_m / 2;
  for (const Point2& corner : {Point2{-x, -y}, Point2{x, -y}, Point2{x, y}, Point2{-x, y}}) {
    box.corners.push_back(T_world_center * corner);
  }
  box.bottom_m = bottom_m;
  box.top_m = top_m;
  box.material = material;
  return box;
}

Solid make_cylinder(const Point2& center, double radius_m, double bottom_m, double top_m, Material material) {
  constexpr int kSides = 24;
  Solid cylinder;
  const double step = 2.0 * kPi / kSides;
  const double outer_m = radius_m * std::sqrt(step / std::sin(step));
  for (int i = 0; i < kSides; ++i) {
    cylinder.corners.push_back(
        {center.x_m + outer_m * std::cos(i * step), center.y_m + outer_m * std::sin(i * step)});
  }
  cylinder.bottom_m = bottom_m;
  cylinder.top_m = top_m;
  cylinder.material = material;
  return cylinder;
}

Solid transformed(const Pose2& T_a_b, const Solid& solid_b) {
  Solid result = solid_b;
  for (Point2& corner : result.corners) corner = T_a_b * corner;
  return result;
}

double segment_distance_m(const Point2& a, const Point2& b, const Point2& point) {
  const double dx = b.x_m - a.x_m, dy = b.y_m - a.y_m;
  const double length2 = dx * dx + dy * dy;
  double t = length2 > 0.0 ? ((point.x_m - a.x_m) * dx + (point.y_m - a.y_m) * dy) / length2 : 0.0;
  t = std::clamp(t, 0.0, 1.0);
  return std::hypot(point.x_m - (a.x_m + t * dx), point.y_m - (a.y_m + t * dy));
}

bool footprint_contains(const Solid& solid, const Point2& point) {
  const std::size_t n = solid.corners.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Point2 &a = solid.corners[i], &b = solid.corners[(i + 1) % n];
    if ((b.x_m - a.x_m) * (point.y_m - a.y_m) - (b.y_m - a.y_m) * (point.x_m - a.x_m) < 0.0) return false;
  }
  return n > 2;
}

double footprint_distance_m(const Solid& solid, const Point2& point) {
  if (footprint_contains(solid, point)) return 0.0;
  double best = std::numeric_limits<double>::infinity();
  const std::size_t n = solid.corners.size();
  for (std::size_t i = 0; i < n; ++i) {
    best = std::min(best, segment_distance_m(solid.corners[i], solid.corners[(i + 1) % n], point));
  }
  return best;
}

}  // namespace knav
