// What a whole frame costs the local mapper: filter, view check, integrating, removing, and the virtual scan.
#include <benchmark/benchmark.h>

#include "test/tsdf_local_mapper/room_world.h"
#include "tsdf_local_mapper/local_mapper.h"

namespace knav {
namespace {

/// Frames of a robot that goes round in a furnished room, simulated beforehand. A short window, so that every
/// frame also leaves it.
void whole_step(benchmark::State& state) {
  const RoomWorld world = RoomWorld::furnished();
  LocalMapperConfig config;
  config.filter.particles = static_cast<int>(state.range(0));
  config.window.duration_s = 2.0;
  LocalMapper mapper(config);
  DrivenRobot robot;
  std::vector<DepthProfile> profiles;
  std::vector<Pose2> odometry;
  for (int k = 0; k < 600; ++k) {
    robot.drive(0.02, 0.02);
    profiles.push_back(world.profile(robot.T_world_base, k / 30.0));
    odometry.push_back(robot.T_odom_base);
  }
  RangeScan scan;
  std::size_t next = 0;
  const auto frame = [&] {
    const double stamp_s = 1.0 + static_cast<double>(next) / 30.0;
    DepthProfile profile = profiles[next];
    profile.stamp_s = stamp_s;
    mapper.add_odometry(stamp_s, odometry[next]);
    mapper.update(profile, Pose2{});
    mapper.extract_scan_360(&scan);
    ++next;
  };
  for (int k = 0; k < 90; ++k) frame();
  for (auto _ : state) frame();
}
BENCHMARK(whole_step)->Arg(1000)->Arg(10000)->Iterations(500)->Unit(benchmark::kMillisecond);

/// The square of 20 m round the robot as an occupancy grid, after three seconds of going round.
void local_map(benchmark::State& state) {
  const RoomWorld world = RoomWorld::furnished();
  LocalMapper mapper{LocalMapperConfig()};
  DrivenRobot robot;
  for (int k = 0; k < 90; ++k) {
    robot.drive(0.02, 0.05);
    mapper.add_odometry(k / 30.0, robot.T_odom_base);
    mapper.update(world.profile(robot.T_world_base, k / 30.0), Pose2{});
  }
  OccupancyGrid map;
  for (auto _ : state) mapper.extract_local_map(&map);
}
BENCHMARK(local_map)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace knav
