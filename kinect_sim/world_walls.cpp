#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "kinect_sim/world_parts.h"

namespace knav {
namespace {

struct Opening {
  Point2 at;
  double width_m, lintel_m;
  bool frame;
};

struct WallShape {
  double height_m, thickness_m;
  Material material;
};

std::vector<Opening> read_openings(YamlMap& map) {
  std::vector<Opening> openings;
  for (YamlMap& part : map.maps("openings")) {
    Opening opening{part.point("at"), part.number("width_m", 0.2, 50, 0.9),
                    part.number("lintel_m", 0.5, 20, 2.1), part.flag("frame", true)};
    part.finish();
    openings.push_back(opening);
  }
  return openings;
}

WallShape read_shape(YamlMap& map, const WorldDefaults& defaults) {
  return {map.number("height_m", 0.05, 20, defaults.wall_height_m),
          map.number("thickness_m", 0.01, 2, defaults.wall_thickness_m),
          map.choice<Material>("material",
                               {{"wall", Material::kWall},
                                {"wood", Material::kWood},
                                {"metal", Material::kMetal},
                                {"dark", Material::kDark},
                                {"fabric", Material::kFabric}},
                               Material::kWall)};
}

/// One straight wall with its openings; `extend` lengthens the ends by half the thickness so that corners
/// close.
void add_segment(const YamlMap& map, const Point2& from, const Point2& to, const WallShape& shape,
                 std::vector<Opening> openings, bool extend, std::vector<Solid>* solids) {
  const double length = std::hypot(to.x_m - from.x_m, to.y_m - from.y_m);
  if (length < 0.01) map.fail("", "has two equal points, so a wall of no length");
  const Pose2 T_world_wall{from.x_m, from.y_m, std::atan2(to.y_m - from.y_m, to.x_m - from.x_m)};
  const Pose2 T_wall_world = T_world_wall.inverse();
  const auto along = [&](const Opening& o) { return (T_wall_world * o.at).x_m; };
  std::sort(openings.begin(), openings.end(),
            [&](const Opening& a, const Opening& b) { return along(a) < along(b); });
  const auto piece = [&](double start, double end, double bottom, double top, double thickness) {
    if (end - start < 1e-6 || top - bottom < 1e-6) return;
    solids->push_back(make_box(T_world_wall * Pose2{(start + end) / 2, 0, 0}, end - start, thickness, bottom,
                               top, shape.material));
  };
  const double cap = extend ? shape.thickness_m / 2 : 0.0;
  double cursor = -cap;
  for (const Opening& opening : openings) {
    const double start = along(opening) - opening.width_m / 2, end = start + opening.width_m;
    if (start < -1e-6 || end > length + 1e-6) {
      map.fail("openings", fmt::format("has an opening at [{}, {}] that reaches beyond the wall's end",
                                       opening.at.x_m, opening.at.y_m));
    }
    if (start < cursor - 1e-6 && cursor > 0.0) {
      map.fail("openings", fmt::format("has an opening at [{}, {}] that overlaps another", opening.at.x_m,
                                       opening.at.y_m));
    }
    piece(cursor, start, 0.0, shape.height_m, shape.thickness_m);
    piece(start, end, opening.lintel_m, shape.height_m, shape.thickness_m);
    if (opening.frame) {
      // Door frames stand 3 cm out of the wall: what a long corridor is recognised by.
      const double proud = shape.thickness_m + 0.06;
      piece(start - 0.06, start, 0.0, std::min(opening.lintel_m + 0.06, shape.height_m), proud);
      piece(end, end + 0.06, 0.0, std::min(opening.lintel_m + 0.06, shape.height_m), proud);
    }
    cursor = end;
  }
  piece(cursor, length + cap, 0.0, shape.height_m, shape.thickness_m);
}

/// Gives each opening to the segment it lies on.
void add_polyline(const YamlMap& map, const std::vector<Point2>& points, const WallShape& shape,
                  const std::vector<Opening>& openings, std::vector<Solid>* solids) {
  std::vector<std::vector<Opening>> of_segment(points.size() - 1);
  for (const Opening& opening : openings) {
    std::size_t best = 0;
    double best_m = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
      const double d = segment_distance_m(points[i], points[i + 1], opening.at);
      if (d < best_m) {
        best_m = d;
        best = i;
      }
    }
    if (best_m > shape.thickness_m) {
      map.fail("openings", fmt::format("has an opening at [{}, {}], {:.2f} m off the wall", opening.at.x_m,
                                       opening.at.y_m, best_m));
    }
    of_segment[best].push_back(opening);
  }
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    add_segment(map, points[i], points[i + 1], shape, of_segment[i], true, solids);
  }
}

}  // namespace

void read_wall(YamlMap& map, const WorldDefaults& defaults, std::vector<Solid>* solids) {
  const WallShape shape = read_shape(map, defaults);
  const std::vector<Point2> points = map.points("points");
  if (points.size() < 2) map.fail("points", "must name at least two points");
  const std::vector<Opening> openings = read_openings(map);
  map.finish();
  add_polyline(map, points, shape, openings, solids);
}

void read_room(YamlMap& map, const WorldDefaults& defaults, std::vector<Solid>* solids) {
  const WallShape shape = read_shape(map, defaults);
  map.text("name", "");
  const std::vector<double> x = map.numbers("x", 2), y = map.numbers("y", 2);
  if (x[1] <= x[0]) map.fail("x", "must rise");
  if (y[1] <= y[0]) map.fail("y", "must rise");
  const std::vector<Opening> openings = read_openings(map);
  map.finish();
  add_polyline(map, {{x[0], y[0]}, {x[1], y[0]}, {x[1], y[1]}, {x[0], y[1]}, {x[0], y[0]}}, shape, openings,
               solids);
}

}  // namespace knav
