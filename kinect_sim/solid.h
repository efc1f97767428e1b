#pragma once

#include <cstdint>
#include <vector>

#include "core/pose2.h"

namespace knav {

/// What a surface is made of, as far as a Kinect cares.
enum class Material : std::uint8_t {
  kWall,
  kFloor,
  kCeiling,
  kWood,
  kFabric,
  kMetal,
  kDark,
  kPerson,
  kGlass,
  kSun,
  kPaper,
  kInk
};

/// Share of the projector's light that comes back, in [0, 1]; 0 for glass (seen through) and sun patches
/// (blinding).
double albedo(Material material);

/// An upright convex prism: every wall piece, box, table leg and pillar of a world. Frame: world.
struct Solid {
  std::vector<Point2> corners;  ///< counter-clockwise, convex
  double bottom_m = 0.0;        ///< above the floor
  double top_m = 2.5;
  Material material = Material::kWall;
};

Solid make_box(const Pose2& T_world_center, double length_m, double width_m, double bottom_m, double top_m,
               Material material);
/// A cylinder as a regular polygon of 24 sides whose area is the circle's.
Solid make_cylinder(const Point2& center, double radius_m, double bottom_m, double top_m, Material material);
Solid transformed(const Pose2& T_a_b, const Solid& solid_b);

/// Distance [m] from a point to the prism's footprint; 0 inside.
double footprint_distance_m(const Solid& solid, const Point2& point);
bool footprint_contains(const Solid& solid, const Point2& point);
/// Distance [m] from a point to the segment a-b.
double segment_distance_m(const Point2& a, const Point2& b, const Point2& point);

}  // namespace knav
