#include <gtest/gtest.h>

#include "brin_benchmark/benchmark.h"
#include "core/error.h"

namespace knav {
namespace {

const char* const kRoom = R"(
name: room
wall_height_m: 2.5
wall_thickness_m: 0.12
spawn: [0, 0, 0]
walls:
  - points: [[-1.5, -2], [4.5, -2], [4.5, 2], [-1.5, 2], [-1.5, -2]]
boxes:
  - {name: crate, at: [1.6, -1.4], size: [0.8, 0.6, 0.8]}
  - {name: shelf, at: [4.2, 1.0], size: [0.4, 1.2, 1.8]}
places:
  near: [1.0, 0.0, 0]
  far: [2.8, 0.0, 0]
)";

const char* const kTour = R"(
speed_mps: 0.6
turn_radps: 0.9
steps:
  - drive: [[1.0, 0.0], [2.8, 0.0]]
  - face: 180
  - drive: [[0.0, 0.0]]
  - face: 0
)";

BenchmarkSetup room_setup() {
  BenchmarkSetup setup;
  setup.world = parse_world(kRoom, "room.yaml");
  setup.tour = parse_tour(kTour, "tour.yaml");
  setup.sequence = {"far", "near"};
  setup.simulator.sensor = "calibrated";
  return setup;
}

TEST(Benchmark, RobotMapsARoomAndReachesItsWaypoints) {
  const BenchmarkSetup setup = room_setup();
  std::vector<Waypoint> waypoints;
  const BuiltMap built = map_world(setup, &waypoints, [](const std::string&, double) {});
  ASSERT_EQ(waypoints.size(), 2u);
  EXPECT_NEAR(waypoints[0].T_world_robot.x_m, 2.8, 0.1);
  const RunResult result =
      run_sequence(setup, setup.world, built.map, waypoints, [](const std::string&, double) {}).result;
  ASSERT_EQ(result.legs.size(), 2u);
  for (const Leg& leg : result.legs) {
    EXPECT_TRUE(leg.reached) << leg.waypoint << ": " << leg.reason;
    // Goal tolerance 0.05 m plus three times the 0.05 m that localization is asked for in a furnished
    // building.
    EXPECT_LT(leg.positioning_error_m, 0.20) << leg.waypoint;
  }
  EXPECT_EQ(result.collisions, 0u);
  EXPECT_GT(result.distance_m, 4.0);
}

TEST(Benchmark, PlaceOffTheTourIsRefusedByName) {
  BenchmarkSetup setup = room_setup();
  setup.sequence = {"nowhere"};
  std::vector<Waypoint> waypoints;
  setup.tour.steps.resize(1);
  setup.tour.steps[0].path = {{0.5, 0.0}};
  EXPECT_THROW(map_world(setup, &waypoints, [](const std::string&, double) {}), UserError);
  setup.sequence = {"far"};
  setup.waypoint_within_m = 0.5;
  EXPECT_THROW(map_world(setup, &waypoints, [](const std::string&, double) {}), UserError);
}

}  // namespace
}  // namespace knav
