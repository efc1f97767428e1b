#include "localizer_benchmark/building.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "brin_benchmark/floor_plan.h"
#include "brin_benchmark/layout.h"
#include "core/error.h"
#include "core/file_io.h"
#include "localizer_benchmark/image_world.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

constexpr double kRobotRadius_m = 0.20;
constexpr int kPeople = 10;
/// The driver of a tour does not dodge: people walk where they can.
constexpr double kRoomToPass_m = 1.2;
/// Nor do people: who stands before the robot turns back after a while, or both would stand there for good.
constexpr double kGivesWay_s = 8.0;
constexpr int kPlaces = 14;
constexpr double kMovedShare = 0.3;
constexpr int kCalmRun = 3;  // of lay_out's runs this and every sixth from it have no crowd

Point2 position(const Pose2& pose) { return {pose.x_m, pose.y_m}; }

std::map<std::string, Pose2> places_of(const FloorPlan& plan, const WorldConfig& world) {
  return world.places.empty() ? choose_places(plan, world, kPlaces) : world.places;
}

std::string point_text(const Point2& p) { return fmt::format("[{:.2f}, {:.2f}]", p.x_m, p.y_m); }

double radius_m(const WorldConfig& world, const WorldPiece& piece) {
  double radius = 0.0;
  for (std::size_t i = piece.first; i < piece.first + piece.count; ++i) {
    for (const Point2& c : world.solids[i].corners) radius = std::max(radius, std::hypot(c.x_m - piece.at.x_m, c.y_m - piece.at.y_m));
  }
  return radius;
}

/// Pillars, and what hangs on a wall, stay where they are.
bool is_furniture(const WorldConfig& world, const WorldPiece& piece) {
  bool on_floor = false;
  for (std::size_t i = piece.first; i < piece.first + piece.count; ++i) {
    const Solid& solid = world.solids[i];
    if (solid.material == Material::kWall || solid.top_m >= 2.3) return false;
    on_floor = on_floor || solid.bottom_m < 0.05;
  }
  return on_floor;
}

/// A share of the furniture to other places near by, wherever the building stays passable.
YAML::Node move_furniture(const FloorPlan& plan, const WorldConfig& world, const std::vector<Point2>& must_reach, int seed,
                          std::vector<Solid>* moved_to, std::string* words) {
  RandomStream random(static_cast<std::uint64_t>(seed), random_stream::kChanges, 0, 5);
  std::vector<WorldPiece> pieces;
  for (const WorldPiece& piece : world.pieces) {
    if (is_furniture(world, piece)) pieces.push_back(piece);
  }
  const std::size_t all = pieces.size();
  for (std::size_t i = pieces.size(); i > 1; --i) {
    std::swap(pieces[i - 1], pieces[std::min(i - 1, static_cast<std::size_t>(random.uniform() * static_cast<double>(i)))]);
  }
  const auto wanted = static_cast<std::size_t>(std::lround(kMovedShare * static_cast<double>(all)));
  YAML::Node moved;
  std::vector<Solid>& stands = *moved_to;
  std::vector<std::pair<Point2, double>> taken;
  for (const WorldPiece& piece : pieces) {
    if (moved.size() >= wanted) break;
    const double radius = radius_m(world, piece);
    for (int attempt = 0; attempt < 30; ++attempt) {
      const Pose2 to{piece.at.x_m + random.normal(0.0, 1.0), piece.at.y_m + random.normal(0.0, 1.0), random.uniform(-kPi, kPi)};
      const Point2 p = position(to);
      const bool free = plan.clearance_m(p) > radius + 0.05 &&
                        std::none_of(must_reach.begin(), must_reach.end(), [&](const Point2& q) { return std::hypot(p.x_m - q.x_m, p.y_m - q.y_m) < radius + 0.5; }) &&
                        std::none_of(taken.begin(), taken.end(), [&](const auto& t) { return std::hypot(p.x_m - t.first.x_m, p.y_m - t.first.y_m) < radius + t.second + 0.05; });
      if (!free) continue;
      stands.push_back(make_box(to, 2.0 * radius, 2.0 * radius, 0.0, 1.0, Material::kWood));
      if (!plan.connected(must_reach, stands)) {
        stands.pop_back();
        continue;
      }
      taken.emplace_back(p, radius);
      moved.push_back(YAML::Load(fmt::format("{{from: [{:g}, {:g}], to: [{:.2f}, {:.2f}, {:.0f}]}}", piece.at.x_m, piece.at.y_m, to.x_m, to.y_m, to.yaw_rad * 180.0 / kPi)));
      break;
    }
  }
  *words = fmt::format("{} of {} pieces of furniture moved", moved.size(), all);
  return moved;
}

/// Furniture moved, doors that are closed for good, and people; what the benchmark of the whole robot adds beside is left out.
YAML::Node changes_of(const WorldConfig& world, int seed, std::string* words) {
  const FloorPlan plan(world, kRobotRadius_m);
  const auto places = places_of(plan, world);
  std::vector<std::vector<Point2>> legs;
  Point2 at = position(world.spawn);
  for (const auto& [name, pose] : places) {
    std::vector<Point2> way = plan.path(at, position(pose));
    if (way.size() < 2) continue;
    legs.push_back(std::move(way));
    at = position(pose);
  }
  LayoutConfig config;
  config.seed = seed;
  config.moved_share = 0.0;
  const auto run = [&](int k) { return YAML::Load("runs:\n" + make_run(plan, world, places, legs, config, k))["runs"][0]; };
  const YAML::Node calm = run(kCalmRun);
  YAML::Node changes;
  std::vector<Point2> must_reach{position(world.spawn)};
  for (const auto& [name, pose] : places) must_reach.push_back(position(pose));
  std::string furniture;
  std::vector<Solid> stands;
  const YAML::Node moved = move_furniture(plan, world, must_reach, seed, &stands, &furniture);
  if (moved.size() > 0) changes["moved"] = moved;
  std::size_t closed = 0;
  for (const YAML::Node& door : calm["door_states"]) {
    if (!door["open_deg"]) continue;  // a door that is the only way closes for half a minute only
    changes["door_states"].push_back(door);
    ++closed;
  }
  const auto in_the_way = [&](const YAML::Node& person) {
    for (const YAML::Node& waypoint : person["path"]) {
      const YAML::Node at = waypoint.IsMap() ? waypoint["at"] : waypoint;
      const Point2 p{at[0].as<double>(), at[1].as<double>()};
      if (plan.clearance_m(p) < kRoomToPass_m) return true;
      if (std::any_of(stands.begin(), stands.end(), [&](const Solid& s) { return footprint_distance_m(s, p) < 0.4; })) return true;
    }
    return false;
  };
  for (int k = kCalmRun; k < 240 && changes["people"].size() < kPeople; k += 6) {
    const YAML::Node people = run(k)["people"];
    for (std::size_t i = 0; i < people.size() && changes["people"].size() < kPeople; ++i) {
      YAML::Node person = people[i];
      if (in_the_way(person)) continue;
      person["name"] = fmt::format("person {}", changes["people"].size() + 1);
      person["gives_way_s"] = kGivesWay_s;
      changes["people"].push_back(person);
    }
  }
  *words = fmt::format("{}, {} of {} doors closed, {} people", furniture, closed, world.doors.size(), changes["people"].size());
  return changes;
}

}  // namespace

BuildingSource parse_building(const std::string& text) {
  BuildingSource source;
  const auto equals = text.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw UserError(fmt::format("--building '{}': must be NAME=WORLD.yaml or NAME=IMAGE@RESOLUTION.", text));
  }
  source.name = text.substr(0, equals);
  source.file = text.substr(equals + 1);
  const auto at = source.file.rfind('@');
  if (at != std::string::npos) {
    try {
      source.resolution_m = std::stod(source.file.substr(at + 1));
    } catch (const std::exception&) {
    }
    if (!(source.resolution_m > 0.0)) {
      throw UserError(fmt::format("--building '{}': what follows the @ must be metres a pixel.", text));
    }
    source.file.resize(at);
  }
  if (!fs::exists(source.file)) throw UserError(fmt::format("--building '{}': there is no {}.", text, source.file));
  return source;
}

Building prepare_building(const BuildingSource& source, const std::string& folder, int seed) {
  fs::create_directories(folder);
  Building building;
  building.name = source.name;
  building.world_file = source.file;
  building.tour_file = source.tour_file;
  if (source.resolution_m > 0.0) {
    building.world_file = fmt::format("{}/{}.yaml", folder, source.name);
    write_image_world(source.file, source.resolution_m, building.world_file, seed);
  }
  const WorldConfig world = load_world(building.world_file);
  building.solids = world.solids.size();
  const YAML::Node changes = changes_of(world, seed, &building.changes);
  building.changed_file = fmt::format("{}/{}_changed.yaml", folder, source.name);
  write_text_atomically(building.changed_file, fmt::format("base: {}\n", fs::absolute(building.world_file).string()) + YAML::Dump(changes) + "\n");
  return building;
}

std::string lay_out_drive(const WorldConfig& world, double length, int seed) {
  const FloorPlan plan(world, kRobotRadius_m);
  std::vector<Point2> stops;
  for (const auto& [name, pose] : choose_places(plan, world, kPlaces)) stops.push_back(position(pose));
  std::string text = "speed_mps: 0.6\nturn_radps: 0.8\nsteps:\n  - wait: 1.0\n";
  Point2 at = position(world.spawn);
  double driven_m = 0.0;
  for (std::uint64_t round = 0; driven_m < length; ++round) {
    if (round > 1000) throw UserError(world.file + ": its places cannot be reached.");
    RandomStream random(static_cast<std::uint64_t>(seed), random_stream::kChanges, round, 2);
    for (std::size_t i = stops.size(); i > 1; --i) {
      std::swap(stops[i - 1], stops[std::min(i - 1, static_cast<std::size_t>(random.uniform() * static_cast<double>(i)))]);
    }
    for (const Point2& stop : stops) {
      const std::vector<Point2> way = plan.path(at, stop);
      if (way.size() < 2 || length_m(way) < 2.0) continue;
      text += "  - drive: [";
      for (std::size_t i = 1; i < way.size(); ++i) text += (i > 1 ? ", " : "") + point_text(way[i]);
      text += "]\n  - turn: 360\n";
      driven_m += length_m(way);
      at = stop;
      if (driven_m >= length) break;
    }
  }
  return text + "  - wait: 1.0\n";
}

}  // namespace knav
