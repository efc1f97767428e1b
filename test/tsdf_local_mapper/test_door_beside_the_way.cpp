// A door that the robot drives up to along its wall, with a Kinect's narrow view: what the wall before it hides must
// not close it, and the wall itself must stay.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "core/contour.h"
#include "tsdf_local_mapper/local_map.h"

namespace knav {
namespace {

struct Segment {
  double ax, ay, bx, by;
};

/// A corridor of 2 m along x; its left wall, 12 cm thick, has a door from x = 3.0 to 3.9, with a room behind it.
const std::vector<Segment> kWorld = {{-20, -1, 20, -1},     {-20, 1, 3.0, 1},       {3.9, 1, 20, 1},
                                     {3.0, 1, 3.0, 1.12},   {3.9, 1, 3.9, 1.12},    {3.0, 1.12, -20, 1.12},
                                     {3.9, 1.12, 20, 1.12}, {-20, 5, 20, 5}};

double range_m(double x, double y, double dx, double dy) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Segment& s : kWorld) {
    const double ex = s.bx - s.ax, ey = s.by - s.ay, determinant = dx * ey - dy * ex;
    if (std::fabs(determinant) < 1e-12) continue;
    const double t = ((s.ax - x) * ey - (s.ay - y) * ex) / determinant;
    const double u = ((s.ax - x) * dy - (s.ay - y) * dx) / determinant;
    if (t > 1e-6 && u >= 0.0 && u <= 1.0) nearest = std::min(nearest, t);
  }
  return nearest;
}

class DoorBesideTheWay : public ::testing::Test {
 protected:
  /// The robot comes along the corridor until the door is about to leave the view, 57 degrees wide.
  DoorBesideTheWay() : grid_(wide(), 12.0) { come_along(wide().truncation.edge_width_m); }

  /// A truncation at which the shadow reaches across the door: with a narrower one it closes less.
  static TsdfConfig wide() {
    TsdfConfig config;
    config.truncation.base_m = 0.4;
    return config;
  }

  void come_along(double edge_width_m) {
    grid_.clear();
    std::uint32_t sequence = 0;
    for (double x = -3.0; x <= 1.8; x += 0.02) {
      DepthProfile profile;
      profile.fx_px = 585;
      profile.cx_px = 319.5;
      profile.height_class.assign(640, HeightClass::kMiddle);
      for (int u = 0; u < 640; ++u) {
        const double right = (u - profile.cx_px) / profile.fx_px, stretch = std::hypot(1.0, right);
        const double z = range_m(x, 0.0, 1.0 / stretch, -right / stretch) / stretch;
        profile.z_m.push_back(static_cast<float>(std::min(z, 15.0)));
        profile.free_from_m.push_back(1.3f);  // nearer the floor is out of view
        profile.free_to_m.push_back(profile.z_m.back());
      }
      ObservationLimits limits;
      limits.truncation = wide().truncation;
      limits.truncation.edge_width_m = edge_width_m;
      TsdfObservation o;
      observation_from(profile, limits, &o);
      o.sequence = ++sequence;
      o.T_map_sensor = {x, 0.0, 0.0};
      grid_.add(o);
    }
  }

  /// Rays from before the door that end in its opening, a robot's radius from both jambs.
  int rays_that_end_in_the_door(double surface_within) const {
    ContourConfig config;
    config.surface_within = surface_within;
    int ends = 0;
    for (double x = 3.25; x <= 3.65; x += 0.01) {
      const RayEnd end = cast_ray(grid_, config, x, 0.5, 0.0, 1.0, 1.0);
      if (end.kind == RayEnd::Kind::kSurface) ++ends;
    }
    return ends;
  }
  int occupied_in_the_door(double surface_within) const {
    OccupancyGrid map;
    extract_occupancy(grid_, 3.0, 0.0, 16.0, SurfaceRule(surface_within), &map);
    int occupied = 0;
    for (double x = 3.2; x <= 3.7; x += 0.05) {
      for (double y = 0.8; y <= 1.4; y += 0.05) {
        if (map.value[map.geometry.index(map.geometry.cell_x(x), map.geometry.cell_y(y))] == 100) ++occupied;
      }
    }
    return occupied;
  }

  TsdfGrid grid_;
};

TEST_F(DoorBesideTheWay, TheShadowOfTheWallBeforeItDoesNotCloseIt) {
  EXPECT_EQ(rays_that_end_in_the_door(ContourConfig{}.surface_within), 0);
  EXPECT_EQ(occupied_in_the_door(ContourConfig{}.surface_within), 0);
  // Either rule alone is enough where nothing errs.
  EXPECT_EQ(occupied_in_the_door(1.0), 0);
  come_along(0.0);
  EXPECT_EQ(rays_that_end_in_the_door(ContourConfig{}.surface_within), 0);
  EXPECT_EQ(occupied_in_the_door(ContourConfig{}.surface_within), 0);
  // The paper's, any change of sign and all of the truncation behind a surface, does close it: that is what they are for.
  EXPECT_GT(rays_that_end_in_the_door(1.0), 0);
  EXPECT_GT(occupied_in_the_door(1.0), 0);
}

TEST_F(DoorBesideTheWay, TheWallsSeenAtSharpAnglesStayWithoutAHole) {
  OccupancyGrid map;
  extract_occupancy(grid_, 0.0, 0.0, 20.0, SurfaceRule(ContourConfig{}.surface_within), &map);
  const GridGeometry& g = map.geometry;
  for (double x = -0.5; x < 9.0; x += 0.05) {
    for (const double wall_y : {-1.0, 1.0}) {
      if (wall_y > 0.0 && x > 2.9 && x < 4.0) continue;
      bool occupied = false;
      for (int dy = -2; dy <= 2; ++dy) {
        occupied = occupied || map.value[g.index(g.cell_x(x), g.cell_y(wall_y) + dy)] == 100;
      }
      EXPECT_TRUE(occupied) << "wall at (" << x << ", " << wall_y << ")";
      const RayEnd end = cast_ray(grid_, ContourConfig{}, x, 0.0, 0.0, wall_y, 3.0);
      EXPECT_EQ(end.kind, RayEnd::Kind::kSurface) << "ray to (" << x << ", " << wall_y << ")";
      EXPECT_NEAR(end.range_m, 1.0, 0.05) << x;
    }
  }
}

}  // namespace
}  // namespace knav
