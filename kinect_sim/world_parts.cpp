#include "kinect_sim/world_parts.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kinect_sim/world_changes.h"

namespace knav {
namespace {

constexpr double kDegree = kPi / 180.0;

Material read_material(YamlMap& map, Material fallback) {
  return map.choice<Material>("material",
                              {{"wall", Material::kWall},
                               {"wood", Material::kWood},
                               {"fabric", Material::kFabric},
                               {"metal", Material::kMetal},
                               {"dark", Material::kDark},
                               {"glass", Material::kGlass}},
                              fallback);
}

Pose2 read_place(YamlMap& map) {
  const Point2 at = map.point("at");
  return {at.x_m, at.y_m, map.number("yaw_deg", -360, 360, 0.0) * kDegree};
}

/// A straight piece from one point to another.
Solid read_panel(YamlMap& map, double thickness_m, double bottom_m, double top_m, Material material) {
  const Point2 from = map.point("from"), to = map.point("to");
  const double length = std::hypot(to.x_m - from.x_m, to.y_m - from.y_m);
  if (length < 0.01) map.fail("to", "equals 'from', so it has no length");
  if (top_m <= bottom_m) map.fail("top_m", "must lie above its bottom");
  const double yaw = std::atan2(to.y_m - from.y_m, to.x_m - from.x_m);
  return make_box({(from.x_m + to.x_m) / 2, (from.y_m + to.y_m) / 2, yaw}, length, thickness_m, bottom_m,
                  top_m, material);
}

void add_legs(const Pose2& place, double length, double width, double leg_m, double height_m,
              Material material, std::vector<Solid>* solids) {
  const double x = (length - leg_m) / 2, y = (width - leg_m) / 2;
  for (const Pose2& corner : {Pose2{-x, -y, 0}, Pose2{x, -y, 0}, Pose2{x, y, 0}, Pose2{-x, y, 0}}) {
    solids->push_back(make_box(place * corner, leg_m, leg_m, 0.0, height_m, material));
  }
}

}  // namespace

void read_box(YamlMap& map, bool low, std::vector<Solid>* solids, std::vector<TimedSolid>* timed) {
  const Pose2 place = read_place(map);
  const std::vector<double> size = map.numbers("size", 3);
  for (const double side : size) {
    if (side <= 0.0) map.fail("size", "must be positive: [length, width, height]");
  }
  if (low && size[2] > 0.25) map.fail("size", "is higher than 0.25 m, so it belongs under 'boxes'");
  const double bottom = low ? 0.0 : map.number("bottom_m", 0, 20, 0.0);
  const Solid box =
      make_box(place, size[0], size[1], bottom, bottom + size[2], read_material(map, Material::kWood));
  const double appears = map.number("appears_s", 0, 1e6, 0.0);
  const double disappears = map.number("disappears_s", 0, 1e6, std::numeric_limits<double>::infinity());
  if (disappears <= appears) map.fail("disappears_s", "must be later than 'appears_s'");
  map.text("name", "");
  map.finish();
  if (appears > 0.0 || std::isfinite(disappears)) {
    timed->push_back({box, appears, disappears});
  } else {
    solids->push_back(box);
  }
}

void read_table(YamlMap& map, std::vector<Solid>* solids) {
  const Pose2 place = read_place(map);
  const std::vector<double> size = map.numbers("size", 2);
  const double leg = map.number("leg_m", 0.01, 0.5, 0.05), height = map.number("height_m", 0.2, 2, 0.74);
  const double top = map.number("top_thickness_m", 0.005, 0.5, 0.03);
  const Material material = read_material(map, Material::kWood);
  map.text("name", "");
  map.finish();
  if (size[0] < 2 * leg || size[1] < 2 * leg) map.fail("size", "is too small for its legs");
  if (top >= height) map.fail("top_thickness_m", "must be less than 'height_m'");
  solids->push_back(make_box(place, size[0], size[1], height - top, height, material));
  add_legs(place, size[0], size[1], leg, height - top, material, solids);
}

void read_chair(YamlMap& map, std::vector<Solid>* solids) {
  const Pose2 place = read_place(map);
  const Material material = read_material(map, Material::kFabric);
  map.finish();
  solids->push_back(make_box(place, 0.44, 0.44, 0.42, 0.47, material));
  solids->push_back(make_box(place * Pose2{-0.20, 0, 0}, 0.04, 0.42, 0.47, 0.92, material));
  add_legs(place, 0.44, 0.44, 0.035, 0.42, Material::kMetal, solids);
}

void read_cylinder(YamlMap& map, std::vector<Solid>* solids) {
  const Point2 at = map.point("at");
  const double radius = map.number("radius_m", 0.005, 20), bottom = map.number("bottom_m", 0, 20, 0.0);
  const double height = map.number("height_m", 0.01, 20);
  const Material material = read_material(map, Material::kWall);
  map.text("name", "");
  map.finish();
  solids->push_back(make_cylinder(at, radius, bottom, bottom + height, material));
}

void read_glass(YamlMap& map, const WorldDefaults& defaults, std::vector<Solid>* solids) {
  const Solid pane =
      read_panel(map, 0.02, 0.0, map.number("height_m", 0.1, 20, defaults.wall_height_m), Material::kGlass);
  const bool posts = map.flag("posts", true);
  map.text("name", "");
  map.finish();
  solids->push_back(pane);
  if (!posts) return;
  // The panes' frame is all that a Kinect or a laser sees of them.
  const Point2 ends[2] = {
      {(pane.corners[0].x_m + pane.corners[3].x_m) / 2, (pane.corners[0].y_m + pane.corners[3].y_m) / 2},
      {(pane.corners[1].x_m + pane.corners[2].x_m) / 2, (pane.corners[1].y_m + pane.corners[2].y_m) / 2}};
  for (const Point2& end : ends) {
    solids->push_back(make_box({end.x_m, end.y_m, 0}, 0.06, 0.06, 0.0, pane.top_m, Material::kMetal));
  }
}

void read_sign(YamlMap& map, std::vector<Solid>* solids) {
  const double bottom = map.number("bottom_m", 0.1, 20, 1.9), top = map.number("top_m", 0.1, 20, 2.3);
  const Solid panel = read_panel(map, 0.03, bottom, top, read_material(map, Material::kWood));
  map.text("name", "");
  map.finish();
  solids->push_back(panel);
}

FloorRect read_floor_rect(YamlMap& map) {
  const Point2 low = map.point("min"), high = map.point("max");
  if (high.x_m <= low.x_m || high.y_m <= low.y_m) map.fail("max", "must lie above and right of 'min'");
  return {low.x_m, low.y_m, high.x_m, high.y_m};
}

void read_stairs(YamlMap& map, std::vector<Solid>* solids, std::vector<FloorRect>* holes) {
  const FloorRect hole = read_floor_rect(map);
  const double yaw =
      map.choice<double>("direction", {{"+x", 0.0}, {"+y", kPi / 2}, {"-x", kPi}, {"-y", -kPi / 2}});
  const double rise = map.number("rise_m", 0.05, 0.4, 0.17), tread = map.number("tread_m", 0.1, 1, 0.28);
  map.text("name", "");
  map.finish();
  holes->push_back(hole);
  const bool along_x = std::abs(std::cos(yaw)) > 0.5;
  const double length = along_x ? hole.max_x_m - hole.min_x_m : hole.max_y_m - hole.min_y_m;
  const double width = along_x ? hole.max_y_m - hole.min_y_m : hole.max_x_m - hole.min_x_m;
  const Pose2 center{(hole.min_x_m + hole.max_x_m) / 2, (hole.min_y_m + hole.max_y_m) / 2, yaw};
  const int steps = static_cast<int>(std::ceil(length / tread));
  for (int i = 0; i < steps; ++i) {
    const double start = -length / 2 + i * tread, end = std::min(start + tread, length / 2);
    const double top = -(i + 1) * rise;
    if (end - start < 1e-3) continue;
    solids->push_back(make_box(center * Pose2{(start + end) / 2, 0, 0}, end - start, width, top - rise, top,
                               Material::kFloor));
  }
}

DoorConfig read_door(YamlMap& map) {
  DoorConfig door;
  door.name = map.text("name", "");
  door.hinge = map.point("hinge");
  door.closed_end = map.point("to");
  door.thickness_m = map.number("thickness_m", 0.01, 0.2, 0.04);
  door.height_m = map.number("height_m", 0.5, 5, 2.05);
  read_door_state(map, &door);
  map.finish();
  if (std::hypot(door.hinge.x_m - door.closed_end.x_m, door.hinge.y_m - door.closed_end.y_m) < 0.1) {
    map.fail("to", "lies on the hinge, so the door has no width");
  }
  return door;
}

PersonConfig read_person(YamlMap& map) {
  using Repeat = PersonConfig::Repeat;
  PersonConfig person;
  person.name = map.text("name", "");
  for (const YAML::Node& node : map.nodes("path")) {
    PersonConfig::Waypoint waypoint;
    if (node.IsSequence()) {
      waypoint.at = map.point_from("path", node);
    } else {
      if (!node.IsMap()) map.fail("path", "must list points [x, y] or {at: [x, y], stand_s: seconds}");
      YamlMap point = map.child("path", node);
      waypoint.at = point.point("at");
      waypoint.stand_s = point.number("stand_s", 0, 1e6, 0.0);
      point.finish();
    }
    person.path.push_back(waypoint);
  }
  if (person.path.empty()) map.fail("path", "must name at least one point");
  person.repeat = map.choice<Repeat>(
      "repeat", {{"loop", Repeat::kLoop}, {"back_and_forth", Repeat::kBackAndForth}, {"once", Repeat::kOnce}},
      Repeat::kBackAndForth);
  person.speed_mps = map.number("speed_mps", 0.05, 3, 1.0);
  person.start_s = map.number("start_s", 0, 1e6, 0.0);
  person.radius_m = map.number("radius_m", 0.1, 1, 0.25);
  person.height_m = map.number("height_m", 0.5, 2.5, 1.75);
  person.polite = map.flag("polite", true);
  person.gives_way_s = map.number("gives_way_s", 0, 1e6, 0.0);
  map.finish();
  return person;
}

}  // namespace knav
