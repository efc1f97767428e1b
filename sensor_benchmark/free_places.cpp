#include "sensor_benchmark/free_places.h"

#include <cmath>

#include "core/error.h"
#include "core/random.h"
#include "kinect_sim/collision_map.h"

namespace knav {
namespace {

constexpr double kReach_m = 4.0;
constexpr double kRobotHeight_m = 0.6;
constexpr int kTries = 100000;

}  // namespace

std::vector<Pose2> free_places(const WorldConfig& world, double clearance_m, int count, std::uint64_t seed) {
  CollisionMap map(world, kRobotHeight_m);
  std::vector<double> doors;
  for (const DoorConfig& door : world.doors) doors.push_back(door_open_at(door, 0.0));
  map.set_doors(doors);
  std::vector<Pose2> anchors;
  for (const auto& [name, place] : world.places) anchors.push_back(place);
  if (anchors.empty()) anchors.push_back(world.spawn);
  const auto is_free = [&](const Point2& at) {
    return map.clearance_m(at) >= clearance_m && map.stairs_distance_m(at) >= clearance_m;
  };
  std::vector<Pose2> places;
  RandomStream random(seed, random_stream::kSensorBenchmark, 3, 0);
  for (int i = 0; i < kTries && static_cast<int>(places.size()) < count; ++i) {
    const Pose2& anchor = anchors[random.bits() % anchors.size()];
    const double direction = random.uniform(-kPi, kPi), reach = random.uniform(0.0, kReach_m);
    const Pose2 place{anchor.x_m + reach * std::cos(direction), anchor.y_m + reach * std::sin(direction),
                      random.uniform(-kPi, kPi)};
    bool reached = is_free({place.x_m, place.y_m});
    for (double part = 0.0; reached && part < 1.0; part += 0.02) {  // not through a wall
      reached = map.clearance_m({anchor.x_m + part * (place.x_m - anchor.x_m),
                                 anchor.y_m + part * (place.y_m - anchor.y_m)}) > 0.05;
    }
    if (reached) places.push_back(place);
  }
  if (static_cast<int>(places.size()) < count) {
    throw UserError(world.file + ": has too little free space around its 'places'.");
  }
  return places;
}

}  // namespace knav
