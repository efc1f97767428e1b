// What changes from run to run: people, obstacles, doors, furniture, sun.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "brin_benchmark/layout.h"

namespace knav {
namespace {

constexpr double kFreePlace_m = 0.7;  ///< nothing is put nearer to a place than this
/// Nobody stands nearer to where the robot is switched on: whoever is against it before the first leg says nothing about it.
constexpr double kFreeStart_m = 1.5;

double distance_m(const Point2& a, const Point2& b) { return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m); }

class RunMaker {
 public:
  RunMaker(const FloorPlan& plan, const WorldConfig& world, const std::map<std::string, Pose2>& places,
           const std::vector<std::vector<Point2>>& legs, const LayoutConfig& config, int run)
      : plan_(plan),
        world_(world),
        legs_(legs),
        config_(config),
        run_(run),
        random_(static_cast<std::uint64_t>(config.seed), random_stream::kChanges,
                static_cast<std::uint64_t>(run), 1),
        open_(plan.reachable(0.45)) {
    must_reach_.push_back({world.spawn.x_m, world.spawn.y_m});
    for (const auto& [name, pose] : places) must_reach_.push_back({pose.x_m, pose.y_m});
    // A 250 m run lasts about this long.
    double length = 0.0;
    for (const auto& leg : legs) length += length_m(leg);
    duration_s_ = length / 0.4;
  }

  std::string make() {
    const bool crowd = run_ % 6 == 4;
    std::string text = fmt::format("  - name: run {}{}\n", run_ + 1, crowd ? ", a crowd" : "");
    // One after the other: what was put down first is in the way of the rest.
    text += doors();
    text += moved();
    text += boxes();
    text += people(config_.people > 0 ? config_.people : crowd ? 10 : 3 + run_ % 4, crowd);
    if (run_ % 3 == 2) text += sun();
    return text;
  }

 private:
  std::size_t pick(std::size_t count) {
    return std::min(count - 1, static_cast<std::size_t>(random_.uniform() * static_cast<double>(count)));
  }

  bool near_a_place(const Point2& p, double within_m) const {
    return std::any_of(must_reach_.begin(), must_reach_.end(),
                       [&](const Point2& q) { return distance_m(p, q) < within_m; });
  }

  /// Keeps it if every place can still be reached.
  bool stands_for_good(const std::vector<Solid>& solids) {
    std::vector<Solid> all = added_;
    all.insert(all.end(), solids.begin(), solids.end());
    if (!plan_.connected(must_reach_, all)) return false;
    added_ = std::move(all);
    return true;
  }

  /// Doors closed for the whole run where there is another way, and for half a minute where there is none.
  std::string doors() {
    std::string text;
    for (const DoorConfig& door : world_.doors) {
      if (!door.name.empty() && door.name == config_.closed_door) {
        added_.push_back(door_leaf(door, 0.0));
        text += fmt::format("      - {{name: '{}', open_deg: 0}}\n", door.name);
        continue;
      }
      if (door.name.empty() || random_.uniform() > 0.35) continue;
      const double open_deg = door.open_rad * 180.0 / kPi;
      std::string entry;
      if (stands_for_good({door_leaf(door, 0.0)})) {
        entry = fmt::format("{{name: '{}', open_deg: 0}}", door.name);
      } else {
        const double from_s = random_.uniform(20.0, 0.8 * duration_s_);
        entry = fmt::format(
            "{{name: '{}', schedule: [{{at_s: {:.0f}, open_deg: 0}}, {{at_s: {:.0f}, open_deg: {:.0f}}}]}}",
            door.name, from_s, from_s + random_.uniform(20.0, 35.0), open_deg);
      }
      text += "      - " + entry + "\n";
    }
    return text.empty() ? text : "    door_states:\n" + text;
  }

  bool overlaps_something(const std::vector<Solid>& piece, const WorldPiece& self) const {
    const auto touches = [&](const Solid& a, const Solid& b) {
      if (a.bottom_m >= b.top_m || b.bottom_m >= a.top_m) return false;
      for (std::size_t i = 0; i < a.corners.size(); ++i) {
        const Point2 &p = a.corners[i], &q = a.corners[(i + 1) % a.corners.size()];
        for (int k = 0; k < 8; ++k) {
          const double t = k / 8.0;
          if (footprint_distance_m(b, {p.x_m + t * (q.x_m - p.x_m), p.y_m + t * (q.y_m - p.y_m)}) < 0.03)
            return true;
        }
      }
      return false;
    };
    for (const Solid& a : piece) {
      for (std::size_t i = 0; i < world_.solids.size(); ++i) {
        if (i >= self.first && i < self.first + self.count) continue;
        if (touches(a, world_.solids[i]) || touches(world_.solids[i], a)) return true;
      }
      for (const Solid& b : added_) {
        if (touches(a, b) || touches(b, a)) return true;
      }
      for (const auto* points : {&must_reach_, &config_.keep_free}) {
        for (const Point2& p : *points) {
          if (footprint_distance_m(a, p) < kFreePlace_m) return true;
        }
      }
    }
    return false;
  }

  std::string moved() {
    std::string text;
    for (const WorldPiece& piece : world_.pieces) {
      if (random_.uniform() > config_.moved_share) continue;
      const Pose2 to{piece.at.x_m + random_.normal(0.0, 0.5), piece.at.y_m + random_.normal(0.0, 0.5),
                     random_.normal(0.0, 25.0) * kPi / 180.0};
      const Pose2 T = to * Pose2{piece.at.x_m, piece.at.y_m, 0.0}.inverse();
      std::vector<Solid> solids;
      bool furniture = true;
      for (std::size_t i = piece.first; i < piece.first + piece.count; ++i) {
        solids.push_back(transformed(T, world_.solids[i]));
        // Pillars, and what hangs on a wall, stay where they are.
        furniture = furniture && world_.solids[i].material != Material::kWall && world_.solids[i].top_m < 2.3;
      }
      const bool on_floor =
          std::any_of(solids.begin(), solids.end(), [](const Solid& s) { return s.bottom_m < 0.05; });
      if (!furniture || !on_floor || overlaps_something(solids, piece) || !stands_for_good(solids)) continue;
      text += fmt::format("      - {{from: [{:g}, {:g}], to: [{:.2f}, {:.2f}, {:.0f}]}}\n", piece.at.x_m,
                          piece.at.y_m, to.x_m, to.y_m, to.yaw_rad * 180.0 / kPi);
    }
    return text.empty() ? text : "    moved:\n" + text;
  }

  /// A point on one of the robot's ways, not at its ends.
  bool on_the_way(Point2* at) {
    const auto& leg = legs_[pick(legs_.size())];
    const double length = length_m(leg);
    if (length < 5.0) return false;
    *at = point_along(leg, random_.uniform(2.0, length - 2.0));
    return !near_a_place(*at, 1.2);
  }

  std::string boxes() {
    std::string text, low;
    int wanted = 2 + run_ % 3;
    for (int attempt = 0; attempt < 40 && wanted > 0; ++attempt) {
      Point2 at;
      if (!on_the_way(&at)) continue;
      const double length = random_.uniform(0.25, 0.6), width = random_.uniform(0.25, 0.5),
                   yaw = random_.uniform(-90, 90);
      const bool flat = wanted == 1;  // the last one is a low obstacle
      const double height = flat ? random_.uniform(0.05, 0.09) : random_.uniform(0.35, 1.1);
      const Solid box =
          make_box({at.x_m, at.y_m, yaw * kPi / 180.0}, length, width, 0.0, height, Material::kWood);
      if (overlaps_something({box}, {}) || !stands_for_good({box})) continue;
      std::string entry =
          fmt::format("{{at: [{:.2f}, {:.2f}], size: [{:.2f}, {:.2f}, {:.2f}], yaw_deg: {:.0f}", at.x_m,
                      at.y_m, length, width, height, yaw);
      // Some come while the robot drives.
      if (!flat && random_.uniform() < 0.4)
        entry += fmt::format(", appears_s: {:.0f}", random_.uniform(10.0, 0.7 * duration_s_));
      (flat ? low : text) += "      - " + entry + "}\n";
      --wanted;
    }
    if (!text.empty()) text = "    boxes:\n" + text;
    if (!low.empty()) text += "    low_obstacles:\n" + low;
    return text;
  }

  bool clear_for_a_person(const Point2& p) const {
    return std::none_of(added_.begin(), added_.end(),
                        [&](const Solid& s) { return footprint_distance_m(s, p) < 0.35; });
  }

  std::string people(int count, bool crowd) {
    // A crowd gathers in the most open part of the building.
    Point2 center{};
    if (crowd) {
      double best = -1.0;
      for (const Point2& p : open_) {
        const auto room = static_cast<double>(std::count_if(
            open_.begin(), open_.end(), [&](const Point2& q) { return distance_m(p, q) < 5.0; }));
        if (room > best && !near_a_place(p, 1.0)) {
          best = room;
          center = p;
        }
      }
    }
    std::string text;
    for (int i = 0, attempt = 0; i < count && attempt < 50 * count; ++attempt) {
      Point2 from = open_[pick(open_.size())], to = open_[pick(open_.size())];
      // Half of them have business on the robot's way, if there is a place for it.
      if (!crowd && i % 2 == 0 && attempt < 25 * count && !on_the_way(&from)) continue;
      const double distance = distance_m(from, to);
      const Point2 start{world_.spawn.x_m, world_.spawn.y_m};
      if (std::min(distance_m(from, start), distance_m(to, start)) < kFreeStart_m) continue;
      if (crowd ? distance_m(from, center) > 6.0 || distance_m(to, center) > 6.0 || distance < 1.5
                : distance < 3.0 || distance > 15.0) {
        continue;
      }
      const std::vector<Point2> way = plan_.path(from, to);
      if (way.size() < 2 ||
          !std::all_of(way.begin(), way.end(), [&](const Point2& p) { return clear_for_a_person(p); }))
        continue;
      std::string path;
      for (std::size_t k = 0; k < way.size(); ++k) {
        const bool end = k == 0 || k + 1 == way.size();
        path += k > 0 ? ", " : "";
        path += end ? fmt::format("{{at: [{:.2f}, {:.2f}], stand_s: {:.0f}}}", way[k].x_m, way[k].y_m,
                                  random_.uniform(2.0, 20.0))
                    : fmt::format("[{:.2f}, {:.2f}]", way[k].x_m, way[k].y_m);
      }
      text += fmt::format("      - {{name: person {}, path: [{}], speed_mps: {:.2f}, start_s: {:.0f}}}\n",
                          i + 1, path, random_.uniform(0.5, 1.2), random_.uniform(0.0, 30.0));
      ++i;
    }
    return text.empty() ? text : "    people:\n" + text;
  }

  std::string sun() {
    const Point2 at = open_[pick(open_.size())];
    const double w = random_.uniform(0.6, 1.6), h = random_.uniform(0.6, 1.6);
    return fmt::format("    sun_patches:\n      - {{min: [{:.2f}, {:.2f}], max: [{:.2f}, {:.2f}]}}\n",
                       at.x_m - w / 2, at.y_m - h / 2, at.x_m + w / 2, at.y_m + h / 2);
  }

  const FloorPlan& plan_;
  const WorldConfig& world_;
  const std::vector<std::vector<Point2>>& legs_;
  const LayoutConfig& config_;
  int run_;
  RandomStream random_;
  std::vector<Point2> open_, must_reach_;
  std::vector<Solid> added_;
  double duration_s_ = 0.0;
};

}  // namespace

std::string make_run(const FloorPlan& plan, const WorldConfig& world,
                     const std::map<std::string, Pose2>& places, const std::vector<std::vector<Point2>>& legs,
                     const LayoutConfig& config, int run) {
  return RunMaker(plan, world, places, legs, config, run).make();
}

}  // namespace knav
