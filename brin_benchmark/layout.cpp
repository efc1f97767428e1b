#include "brin_benchmark/layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace knav {
namespace {

constexpr double kPlaceClearance_m = 0.6;
constexpr double kStopClearance_m = 0.45;

double distance_m(const Point2& a, const Point2& b) { return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m); }
Point2 position(const Pose2& pose) { return {pose.x_m, pose.y_m}; }

std::string point_text(const Point2& p) { return fmt::format("[{:.2f}, {:.2f}]", p.x_m, p.y_m); }

/// Every place in turn, shuffled anew each time, until the legs are as long as asked.
std::vector<std::string> make_sequence(const FloorPlan& plan, const WorldConfig& world,
                                       const std::map<std::string, Pose2>& places,
                                       const LayoutConfig& config) {
  std::vector<std::string> names;
  for (const auto& place : places) names.push_back(place.first);
  std::vector<std::string> sequence;
  Point2 at = position(world.spawn);
  double length = 0.0;
  for (std::uint64_t round = 0; length < config.sequence_m && round < 1000; ++round) {
    RandomStream random(static_cast<std::uint64_t>(config.seed), random_stream::kChanges, round, 0);
    for (std::size_t i = names.size(); i > 1; --i) {
      std::swap(names[i - 1],
                names[std::min(i - 1, static_cast<std::size_t>(random.uniform() * static_cast<double>(i)))]);
    }
    for (const std::string& name : names) {
      const Point2 to = position(places.at(name));
      if (distance_m(at, to) < 1.0) continue;
      length += length_m(plan.path(at, to));
      at = to;
      sequence.push_back(name);
      if (length >= config.sequence_m) break;
    }
    if (sequence.empty()) throw UserError(world.file + ": its places lie within 1 m of the start.");
  }
  return sequence;
}

}  // namespace

std::map<std::string, Pose2> choose_places(const FloorPlan& plan, const WorldConfig& world, int count) {
  const std::vector<Point2> open = plan.reachable(kPlaceClearance_m);
  if (open.empty()) throw UserError(world.file + ": nowhere can be reached from 'spawn'.");
  std::vector<double> far(open.size(), 1e9);
  Point2 last = position(world.spawn);
  std::map<std::string, Pose2> places;
  for (int k = 0; k < count; ++k) {
    std::size_t best = 0;
    for (std::size_t i = 0; i < open.size(); ++i) {
      far[i] = std::min(far[i], distance_m(open[i], last));
      if (far[i] > far[best]) best = i;
    }
    if (far[best] < 2.0) break;  // the building is small
    last = open[best];
    // Looking the way one comes from the start, into the room.
    const std::vector<Point2> way = plan.path(position(world.spawn), last);
    if (way.size() < 2) {
      far[best] = 0.0;
      --count;
      continue;
    }
    const Point2& before = way[way.size() - 2];
    places[fmt::format("w{}", k + 1)] = {last.x_m, last.y_m,
                                         std::atan2(last.y_m - before.y_m, last.x_m - before.x_m)};
  }
  if (places.size() < 2)
    throw UserError(world.file + ": has no room for two places that can be reached from 'spawn'.");
  return places;
}

std::string make_tour(const FloorPlan& plan, const WorldConfig& world,
                      const std::map<std::string, Pose2>& places, double spacing_m) {
  std::vector<Point2> stops;
  for (const auto& [name, pose] : places) stops.push_back(position(pose));
  const Point2 home = position(world.spawn);
  // Farthest points first, until nothing that can be reached is far from a stop.
  const std::vector<Point2> open = plan.reachable(kStopClearance_m);
  std::vector<double> far(open.size(), 1e9);
  const auto cover = [&](const Point2& p) {
    for (std::size_t i = 0; i < open.size(); ++i) far[i] = std::min(far[i], distance_m(open[i], p));
  };
  cover(home);
  for (const Point2& stop : stops) cover(stop);
  while (!open.empty()) {
    const auto worst = static_cast<std::size_t>(std::max_element(far.begin(), far.end()) - far.begin());
    if (far[worst] < spacing_m) break;
    stops.push_back(open[worst]);
    cover(open[worst]);
  }
  std::string text = fmt::format(
      "# A mapping tour of {}: past every place and within {:g} m of all that can be reached.\n"
      "speed_mps: 0.6\nturn_radps: 0.6\nsteps:\n  - wait: 1.0\n  - mark: start\n",
      world.name, spacing_m);
  const auto drive = [&](const std::vector<Point2>& way) {
    text += "  - drive: [";
    for (std::size_t i = 1; i < way.size(); ++i) text += (i > 1 ? ", " : "") + point_text(way[i]);
    text += "]\n";
  };
  Point2 at = home;
  while (!stops.empty()) {
    // The nearest by the way one must drive; straight distance bounds how many are asked.
    std::sort(stops.begin(), stops.end(),
              [&](const Point2& a, const Point2& b) { return distance_m(at, a) < distance_m(at, b); });
    std::size_t best = stops.size();
    double best_m = 1e9;
    std::vector<Point2> best_way;
    for (std::size_t i = 0; i < stops.size() && distance_m(at, stops[i]) < best_m; ++i) {
      std::vector<Point2> way = plan.path(at, stops[i]);
      if (way.size() < 2 || length_m(way) >= best_m) continue;
      best_m = length_m(way);
      best_way = std::move(way);
      best = i;
    }
    if (best == stops.size()) break;  // none of them can be reached
    drive(best_way);
    text += "  - turn: 360\n";
    at = stops[best];
    stops.erase(stops.begin() + static_cast<std::ptrdiff_t>(best));
  }
  const std::vector<Point2> back = plan.path(at, home);
  if (back.size() > 1) drive(back);
  text +=
      fmt::format("  - face: {:.1f}\n  - mark: start\n  - wait: 1.0\n", world.spawn.yaw_rad * 180.0 / kPi);
  return text;
}

WorldConfig started_inside(const WorldConfig& world, double robot_radius_m) {
  const FloorPlan plan(world, robot_radius_m);
  if (!world.places.empty() || plan.starts_inside()) return world;
  const std::optional<Point2> start = plan.start_inside();
  if (!start) {
    throw UserError(
        world.file + ": nowhere do walls close off a part that holds a robot: it would drive round outside. Of an occupancy "
        "image, occupied_below says what is a wall; grey, which nobody saw, is 205 in map_server's images.");
  }
  WorldConfig moved = world;
  moved.spawn = {std::round(start->x_m * 100.0) / 100.0, std::round(start->y_m * 100.0) / 100.0, world.spawn.yaw_rad};
  return moved;
}

Layout lay_out(const WorldConfig& world, const LayoutConfig& config, const std::string& tour_name) {
  const FloorPlan plan(world, config.robot_radius_m);
  Layout layout;
  layout.places = world.places.empty() ? choose_places(plan, world, config.places) : world.places;
  for (const auto& [name, pose] : layout.places) {
    if (plan.path(position(world.spawn), position(pose)).empty()) {
      throw UserError(fmt::format("{}: place '{}' cannot be reached from 'spawn'.", world.file, name));
    }
  }
  layout.sequence = make_sequence(plan, world, layout.places, config);
  layout.tour = make_tour(plan, world, layout.places, config.tour_spacing_m);
  std::vector<std::vector<Point2>> legs;
  Point2 at = position(world.spawn);
  double length = 0.0;
  for (const std::string& name : layout.sequence) {
    legs.push_back(plan.path(at, position(layout.places.at(name))));
    at = position(layout.places.at(name));
    length += length_m(legs.back());
  }
  layout.changes = fmt::format(
      "# {} runs in {}, {:.0f} m each at least. Keys: docs/benchmark.md.\ntour: {}\nsequence: [{}]\nruns:\n",
      config.runs, world.name, length, tour_name, fmt::join(layout.sequence, ", "));
  for (int run = 0; run < config.runs; ++run)
    layout.changes += make_run(plan, world, layout.places, legs, config, run);
  return layout;
}

}  // namespace knav
