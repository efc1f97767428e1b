#include "kinect_sim/world_changes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/config.h"

namespace knav {
namespace {

constexpr double kSamePlace_m = 0.1;

/// The piece that stands at a point; `key` fails if there is none.
WorldPiece& piece_at(const YamlMap& map, const char* key, const Point2& at, WorldConfig* world) {
  WorldPiece* nearest = nullptr;
  double nearest_m = 1e9;
  for (WorldPiece& piece : world->pieces) {
    const double d = std::hypot(piece.at.x_m - at.x_m, piece.at.y_m - at.y_m);
    if (d < nearest_m) {
      nearest_m = d;
      nearest = &piece;
    }
  }
  if (nearest == nullptr || nearest_m > kSamePlace_m) {
    const std::string where = nearest == nullptr ? "the base has none at all"
                                                 : fmt::format("the nearest stands at [{:g}, {:g}]",
                                                               nearest->at.x_m, nearest->at.y_m);
    map.fail(key, fmt::format("names [{:g}, {:g}], where no box, table, chair or cylinder stands; {}", at.x_m,
                              at.y_m, where));
  }
  return *nearest;
}

/// Turns and shifts a piece about its own place.
void move_piece(const WorldPiece& piece, const Pose2& T_world_new, std::vector<Solid>* solids) {
  const Pose2 T_new_old = T_world_new * Pose2{piece.at.x_m, piece.at.y_m, 0.0}.inverse();
  for (std::size_t i = piece.first; i < piece.first + piece.count; ++i) {
    (*solids)[i] = transformed(T_new_old, (*solids)[i]);
  }
}

void remove_piece(std::size_t index, WorldConfig* world) {
  const WorldPiece piece = world->pieces[index];
  const auto first = world->solids.begin() + static_cast<std::ptrdiff_t>(piece.first);
  world->solids.erase(first, first + static_cast<std::ptrdiff_t>(piece.count));
  world->pieces.erase(world->pieces.begin() + static_cast<std::ptrdiff_t>(index));
  for (WorldPiece& other : world->pieces) {
    if (other.first > piece.first) other.first -= piece.count;
  }
}

void read_door_states(YamlMap& map, WorldConfig* world) {
  for (YamlMap& state : map.maps("door_states")) {
    const std::string name = state.text("name");
    const auto door = std::find_if(world->doors.begin(), world->doors.end(),
                                   [&](const DoorConfig& d) { return d.name == name; });
    if (door == world->doors.end()) {
      std::vector<std::string> names;
      for (const DoorConfig& d : world->doors) names.push_back(d.name);
      const std::string meant = nearest_word(name, names);
      state.fail("name", "names no door of the base: '" + name + "'" +
                             (meant.empty() ? "" : " (did you mean '" + meant + "'?)"));
    }
    read_door_state(state, &*door);
    state.finish();
  }
}

}  // namespace

void read_door_state(YamlMap& map, DoorConfig* door) {
  door->open_rad = map.number("open_deg", -180, 180, door->open_rad * 180.0 / kPi) * kPi / 180.0;
  if (!map.has("schedule")) return;
  door->schedule.clear();
  for (YamlMap& change : map.maps("schedule")) {
    door->schedule.push_back(
        {change.number("at_s", 0, 1e6), change.number("open_deg", -180, 180) * kPi / 180.0});
    change.finish();
    if (door->schedule.size() > 1 &&
        door->schedule.back().at_s <= door->schedule[door->schedule.size() - 2].at_s) {
      map.fail("schedule", "must rise in 'at_s'");
    }
  }
}

void add_piece(const Point2& at, WorldConfig* world, const std::function<void()>& read) {
  const std::size_t first = world->solids.size();
  read();
  if (world->solids.size() > first) world->pieces.push_back({at, first, world->solids.size() - first});
}

void read_changes(YamlMap& map, WorldConfig* world) {
  for (YamlMap& entry : map.maps("moved")) {
    const Point2 from = entry.point("from");
    const Pose2 to = entry.pose_deg("to");
    WorldPiece& piece = piece_at(entry, "from", from, world);
    entry.finish();
    move_piece(piece, to, &world->solids);
    piece.at = {to.x_m, to.y_m};
  }
  for (const Point2& at : map.has("removed") ? map.points("removed") : std::vector<Point2>{}) {
    const WorldPiece& piece = piece_at(map, "removed", at, world);
    remove_piece(static_cast<std::size_t>(&piece - world->pieces.data()), world);
  }
  read_door_states(map, world);
}

}  // namespace knav
