#include "kinect_sim/world.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "core/config.h"
#include "core/error.h"
#include "kinect_sim/world_changes.h"
#include "kinect_sim/world_parts.h"

namespace knav {
namespace {

/// Free in map_server's images, whose free_thresh is 0.196; what nobody saw, 205, is as solid as a wall.
constexpr double kMapServerFree = 206;

/// Checks nothing about what stands where: a world that builds on this one may move it.
WorldConfig parse(const YAML::Node& node, const std::string& file, const std::string& directory, int depth);

void read_occupancy(YamlMap map, const std::string& directory, WorldConfig* world) {
  const std::string image_path = (std::filesystem::path(directory) / map.text("image")).string();
  OccupancyGrid grid;
  grid.geometry.resolution_m = map.number("resolution_m", 0.005, 1);
  if (map.has("origin")) {
    const Point2 origin = map.point("origin");
    grid.geometry.origin_x_m = origin.x_m;
    grid.geometry.origin_y_m = origin.y_m;
  }
  const double height = map.number("height_m", 0.1, 20, 2.6);
  const double threshold = map.number("occupied_below", 1, 255, kMapServerFree);
  const cv::Mat image = cv::imread(image_path, cv::IMREAD_GRAYSCALE);
  if (image.empty()) map.fail("image", "names '" + image_path + "', which cannot be read as an image");
  map.finish();
  grid.geometry.width_cells = image.cols;
  grid.geometry.height_cells = image.rows;
  grid.value.assign(grid.geometry.cell_count(), 0);
  for (int row = 0; row < image.rows; ++row) {
    for (int column = 0; column < image.cols; ++column) {
      if (image.at<std::uint8_t>(row, column) < threshold) {
        grid.value[grid.geometry.index(column, image.rows - 1 - row)] =
            100;  // the image's first row is the top
      }
    }
  }
  const std::vector<Solid> solids = extrude_occupancy(grid, height);
  world->solids.insert(world->solids.end(), solids.begin(), solids.end());
}

void find_bounds(WorldConfig* world) {
  FloorRect& b = world->bounds;
  b = {1e9, 1e9, -1e9, -1e9};
  const auto include = [&](const Point2& p) {
    b.min_x_m = std::min(b.min_x_m, p.x_m - 1.0);
    b.min_y_m = std::min(b.min_y_m, p.y_m - 1.0);
    b.max_x_m = std::max(b.max_x_m, p.x_m + 1.0);
    b.max_y_m = std::max(b.max_y_m, p.y_m + 1.0);
  };
  for (const Solid& solid : world->solids) {
    for (const Point2& corner : solid.corners) include(corner);
  }
  for (const FloorRect& stairs : world->stairs) {
    include({stairs.min_x_m, stairs.min_y_m});
    include({stairs.max_x_m, stairs.max_y_m});
  }
  include({world->spawn.x_m, world->spawn.y_m});
}

bool is_free(const WorldConfig& world, const Point2& at, double radius_m) {
  const auto hits = [&](const Solid& solid) {
    return solid.bottom_m < 1.0 && solid.top_m > 0.02 && footprint_distance_m(solid, at) < radius_m;
  };
  return std::none_of(world.solids.begin(), world.solids.end(), hits) &&
         std::none_of(world.stairs.begin(), world.stairs.end(),
                      [&](const FloorRect& stairs) { return stairs.contains(at.x_m, at.y_m); });
}

void check_free(const WorldConfig& world, StartMustBe start) {
  const auto check = [&](const Point2& at, double radius_m, const std::string& what) {
    if (!is_free(world, at, radius_m)) {
      throw UserError(fmt::format("{}: {} at [{}, {}] stands in an obstacle; move one of them.", world.file,
                                  what, at.x_m, at.y_m));
    }
  };
  if (start == StartMustBe::kFree) check({world.spawn.x_m, world.spawn.y_m}, 0.2, "'spawn'");
  for (const auto& [name, pose] : world.places) check({pose.x_m, pose.y_m}, 0.2, "'places/" + name + "'");
  for (const PersonConfig& person : world.people) {
    for (const auto& waypoint : person.path)
      check(waypoint.at, 0.15, "the path of person '" + person.name + "'");
  }
}

void read_base(YamlMap& map, const std::string& directory, int depth, WorldConfig* world) {
  if (!map.has("base")) return;
  if (depth > 8) map.fail("base", "refers back to itself");
  const std::string path = (std::filesystem::path(directory) / map.text("base")).string();
  *world = parse(load_yaml_file(path), path, std::filesystem::path(path).parent_path().string(), depth + 1);
}

void read_parts(YamlMap& map, const std::string& directory, WorldConfig* world) {
  WorldDefaults defaults;
  defaults.wall_height_m = map.number("wall_height_m", 0.1, 20, 2.6);
  defaults.wall_thickness_m = map.number("wall_thickness_m", 0.01, 2, 0.10);
  if (map.has("occupancy")) read_occupancy(map.map("occupancy"), directory, world);
  for (YamlMap& part : map.maps("rooms")) read_room(part, defaults, &world->solids);
  for (YamlMap& part : map.maps("walls")) read_wall(part, defaults, &world->solids);
  for (YamlMap& part : map.maps("boxes")) {
    add_piece(part.point("at"), world, [&] { read_box(part, false, &world->solids, &world->timed_solids); });
  }
  for (YamlMap& part : map.maps("low_obstacles")) {
    add_piece(part.point("at"), world, [&] { read_box(part, true, &world->solids, &world->timed_solids); });
  }
  for (YamlMap& part : map.maps("tables")) {
    add_piece(part.point("at"), world, [&] { read_table(part, &world->solids); });
  }
  for (YamlMap& part : map.maps("chairs")) {
    add_piece(part.point("at"), world, [&] { read_chair(part, &world->solids); });
  }
  for (YamlMap& part : map.maps("cylinders")) {
    add_piece(part.point("at"), world, [&] { read_cylinder(part, &world->solids); });
  }
  for (YamlMap& part : map.maps("glass")) read_glass(part, defaults, &world->solids);
  for (YamlMap& part : map.maps("signs")) read_sign(part, &world->solids);
  for (YamlMap& part : map.maps("chessboards")) read_chessboard(part, &world->panels);
  for (YamlMap& part : map.maps("markers")) read_marker(part, &world->panels);
  for (YamlMap& part : map.maps("stairs_down")) read_stairs(part, &world->solids, &world->stairs);
  for (YamlMap& part : map.maps("sun_patches")) {
    world->sun_patches.push_back(read_floor_rect(part));
    part.finish();
  }
  for (YamlMap& part : map.maps("doors")) world->doors.push_back(read_door(part));
  for (YamlMap& part : map.maps("people")) world->people.push_back(read_person(part));
}

WorldConfig parse(const YAML::Node& node, const std::string& file, const std::string& directory, int depth) {
  WorldConfig world;
  YamlMap map(node, file, "");
  read_base(map, directory, depth, &world);
  world.file = file;
  world.name = map.text("name", world.name.empty() ? file : world.name);
  world.ceiling_m = map.number("ceiling_m", 0, 30, world.ceiling_m);
  read_changes(map, &world);
  read_parts(map, directory, &world);
  if (map.has("spawn")) world.spawn = map.pose_deg("spawn");
  if (map.has("places")) {
    YamlMap places = map.map("places");
    for (const std::string& name : places.keys()) world.places[name] = places.pose_deg(name.c_str());
  }
  map.finish();
  std::set<std::string> names;
  for (const DoorConfig& door : world.doors) {
    if (!door.name.empty() && !names.insert("door " + door.name).second) {
      map.fail("doors", "names two doors '" + door.name + "'");
    }
  }
  find_bounds(&world);
  return world;
}

}  // namespace

WorldConfig load_world(const std::string& path, StartMustBe start) {
  const YAML::Node node = load_yaml_file(path);
  if (node.IsNull())
    throw UserError(path + ": is empty; a world needs at least walls or an occupancy image.");
  WorldConfig world = parse(node, path, std::filesystem::path(path).parent_path().string(), 0);
  check_free(world, start);
  return world;
}

WorldConfig parse_world(const std::string& text, const std::string& file_name, const std::string& directory) {
  try {
    WorldConfig world = parse(YAML::Load(text), file_name, directory, 0);
    check_free(world, StartMustBe::kFree);
    return world;
  } catch (const YAML::Exception& error) {
    throw UserError(fmt::format("{}: line {}: {}.", file_name, error.mark.line + 1, error.msg));
  }
}

std::vector<Solid> extrude_occupancy(const OccupancyGrid& grid, double height_m) {
  // Greedy rectangles: runs along x, joined over rows while they are equal.
  const GridGeometry& g = grid.geometry;
  std::vector<char> used(g.cell_count(), 0);
  const auto open = [&](int ix, int iy) {
    return grid.value[g.index(ix, iy)] > 50 && !used[g.index(ix, iy)];
  };
  std::vector<Solid> solids;
  for (int iy = 0; iy < g.height_cells; ++iy) {
    for (int ix = 0; ix < g.width_cells; ++ix) {
      if (!open(ix, iy)) continue;
      int end_x = ix, end_y = iy + 1;
      while (end_x < g.width_cells && open(end_x, iy)) ++end_x;
      const auto row_is_open = [&](int row) {
        for (int x = ix; x < end_x; ++x) {
          if (!open(x, row)) return false;
        }
        return true;
      };
      while (end_y < g.height_cells && row_is_open(end_y)) ++end_y;
      for (int y = iy; y < end_y; ++y) {
        for (int x = ix; x < end_x; ++x) used[g.index(x, y)] = 1;
      }
      const double r = g.resolution_m, width = (end_x - ix) * r, depth = (end_y - iy) * r;
      solids.push_back(make_box({g.origin_x_m + ix * r + width / 2, g.origin_y_m + iy * r + depth / 2, 0},
                                width, depth, 0.0, height_m, Material::kWall));
    }
  }
  return solids;
}

Solid door_leaf(const DoorConfig& door, double open_rad) {
  const double dx = door.closed_end.x_m - door.hinge.x_m, dy = door.closed_end.y_m - door.hinge.y_m;
  const double width = std::hypot(dx, dy);
  const Pose2 hinge{door.hinge.x_m, door.hinge.y_m, std::atan2(dy, dx) + open_rad};
  return make_box(hinge * Pose2{width / 2, 0, 0}, width, door.thickness_m, 0.01, door.height_m,
                  Material::kWood);
}

double door_open_at(const DoorConfig& door, double t_s) {
  constexpr double kTurnTime_s = 1.5;
  double open = door.open_rad;
  for (const DoorConfig::Change& change : door.schedule) {
    if (t_s < change.at_s) break;
    open += (change.open_rad - open) * std::min(1.0, (t_s - change.at_s) / kTurnTime_s);
  }
  return open;
}

std::vector<Solid> solids_at(const WorldConfig& world, double t_s) {
  std::vector<Solid> solids = world.solids;
  for (const TimedSolid& timed : world.timed_solids) {
    if (t_s >= timed.appears_s && t_s < timed.disappears_s) solids.push_back(timed.solid);
  }
  for (const DoorConfig& door : world.doors) solids.push_back(door_leaf(door, door_open_at(door, t_s)));
  return solids;
}

}  // namespace knav
