#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "brin_benchmark/layout.h"
#include "brin_benchmark/protocol.h"
#include "core/error.h"
#include "kinect_sim/tour.h"

namespace knav {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

/// Two rooms with a door between them, and a cupboard without one.
const char* const kHouse = R"(
name: house
spawn: [1, 1, 0]
walls:
  - points: [[0, 0], [12, 0], [12, 6], [0, 6], [0, 0]]
  - points: [[6, 0], [6, 6]]
    openings: [{at: [6, 3]}]
  - points: [[10, 6], [10, 4], [12, 4]]
doors:
  - {name: middle, hinge: [6, 2.57], to: [6, 3.43], open_deg: 90}
tables:
  - {at: [3, 4], size: [1.2, 0.8]}
)";

class InAFolder : public testing::Test {
 protected:
  InAFolder() : folder_(testing::TempDir() + "layout") { fs::create_directories(folder_); }
  ~InAFolder() override { fs::remove_all(folder_); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ + "/" + name) << text;
    return folder_ + "/" + name;
  }
  std::string folder_;
};

TEST(FloorPlan, WaysLeadThroughDoorsAndNeverIntoAClosedCupboard) {
  const FloorPlan plan(parse_world(kHouse, "house.yaml"), 0.2);
  const auto path = plan.path({1, 1}, {11, 1});
  ASSERT_GE(path.size(), 2u);
  // Through the door at (6, 3): 5 m and 2 m to it, and the same on the other side.
  EXPECT_GT(length_m(path), 2.0 * std::hypot(5.0, 1.8));
  EXPECT_TRUE(plan.path({1, 1}, {11, 5}).empty());
  for (const Point2& p : plan.reachable(0.3)) EXPECT_FALSE(p.x_m > 10 && p.y_m > 4);
}

TEST(FloorPlan, WhatStandsInTheOnlyDoorCutsTheHouseInTwo) {
  const FloorPlan plan(parse_world(kHouse, "house.yaml"), 0.2);
  const Solid far_off = make_box({3, 1, 0}, 0.3, 0.3, 0, 1, Material::kWood);
  const Solid in_the_door = make_box({6.5, 3, 0}, 0.3, 0.6, 0, 1, Material::kWood);
  EXPECT_TRUE(plan.connected({{1, 1}, {11, 1}}, {far_off}));
  EXPECT_FALSE(plan.connected({{1, 1}, {11, 1}}, {in_the_door}));
  EXPECT_TRUE(plan.connected({{1, 1}, {2, 2}}, {in_the_door}));
}

TEST(FloorPlan, AStartOutsideIsMovedIntoTheLargestPartOfTheBuilding) {
  const std::string house = kHouse;
  const auto started_at = [&](const std::string& spawn) {
    std::string text = house;
    text.replace(text.find("spawn: [1, 1, 0]"), 16, "spawn: " + spawn);
    return started_inside(parse_world(text, "house.yaml"), 0.2).spawn;
  };
  EXPECT_EQ(started_at("[1, 1, 0]").x_m, 1.0);  // inside already
  // The rooms are one part through the open door; there is room for a metre and a half round some points of either.
  const Pose2 moved = started_at("[-0.5, -0.5, 90]");
  const FloorPlan plan(parse_world(house, "house.yaml"), 0.2);
  EXPECT_GE(plan.clearance_m({moved.x_m, moved.y_m}), 1.4);
  EXPECT_FALSE(plan.path({1, 1}, {moved.x_m, moved.y_m}).empty());
  EXPECT_NEAR(moved.yaw_rad, 0.5 * kPi, 1e-9);
  const WorldConfig open_ground = parse_world("walls: [{points: [[0, 0], [5, 0], [5, 5]]}]\nspawn: [2, 3, 0]", "walls.yaml");
  EXPECT_THROW(started_inside(open_ground, 0.2), UserError);
  // Whoever names places knows where the robot starts.
  const WorldConfig known = parse_world("walls: [{points: [[0, 0], [5, 0], [5, 5]]}]\nspawn: [2, 3, 0]\nplaces: {a: [1, 4, 0]}", "walls.yaml");
  EXPECT_EQ(started_inside(known, 0.2).spawn.x_m, 2.0);
}

TEST_F(InAFolder, ALayoutIsReadByTheBenchmarkAndLeavesEveryPlaceReachable) {
  const std::string house = write("house.yaml", kHouse);
  const WorldConfig world = load_world(house);
  LayoutConfig config;
  config.places = 3;
  config.sequence_m = 40.0;
  const Layout layout = lay_out(world, config, "tour.yaml");
  EXPECT_EQ(layout.places.size(), 3u);
  EXPECT_GE(layout.sequence.size(), 3u);
  EXPECT_GT(parse_tour(layout.tour, "tour.yaml").length_m(), 15.0);
  const BenchmarkProtocol protocol = load_protocol(write("changes.yaml", layout.changes));
  ASSERT_EQ(protocol.runs.size(), 12u);
  bool anything = false;
  for (const BenchmarkRun& run : protocol.runs) {
    const WorldConfig changed = changed_world(house, protocol, run);
    anything = anything || !changed.people.empty();
    // With all that stays, and the doors as they end, the robot still gets everywhere.
    WorldConfig in_the_end = changed;
    for (const TimedSolid& timed : changed.timed_solids) in_the_end.solids.push_back(timed.solid);
    for (DoorConfig& door : in_the_end.doors) door.open_rad = door_open_at(door, 1e6);
    in_the_end.timed_solids.clear();
    const FloorPlan plan(in_the_end, config.robot_radius_m);
    for (const auto& [name, pose] : layout.places) {
      EXPECT_TRUE(plan.connected({{pose.x_m, pose.y_m}}, {})) << run.name << ": " << name;
    }
  }
  EXPECT_TRUE(anything);
  EXPECT_EQ(lay_out(world, config, "tour.yaml").changes, layout.changes) << "the same seed, the same bytes";
  config.seed = 2;
  EXPECT_NE(lay_out(world, config, "tour.yaml").changes, layout.changes);
}

TEST(Protocol, TheShippedChangesFitTheBuilding) {
  const std::string folder = std::string(KINECT_NAV_SOURCE_DIR) + "/config/worlds/";
  const BenchmarkProtocol protocol = load_protocol(folder + "brin_changes.yaml");
  EXPECT_EQ(protocol.runs.size(), 12u);
  const WorldConfig world = load_world(folder + "brin_building.yaml");
  for (const std::string& name : protocol.sequence) EXPECT_TRUE(world.places.count(name)) << name;
  for (const BenchmarkRun& run : protocol.runs) {
    EXPECT_GT(changed_world(folder + "brin_building.yaml", protocol, run).people.size(), 2u) << run.name;
  }
}

std::string fault_of(const std::string& path) {
  try {
    load_protocol(path);
  } catch (const UserError& error) {
    return error.what();
  }
  return "no fault";
}

TEST_F(InAFolder, FaultsOfAChangesFileNameFileAndKey) {
  EXPECT_THAT(fault_of(write("a.yaml", "tour: t.yaml\nsequence: [x]\nrun: []\nruns: [{name: q}]")),
              AllOf(HasSubstr("a.yaml"), HasSubstr("'run'"), HasSubstr("did you mean 'runs'")));
  EXPECT_THAT(fault_of(write("b.yaml", "tour: t.yaml\nsequence: []\nruns: [{name: q}]")),
              HasSubstr("'sequence'"));
  EXPECT_THAT(fault_of(write("c.yaml", "tour: t.yaml\nsequence: [x]\nruns: [{places: {y: [0, 0, 0]}}]")),
              HasSubstr("runs[0]/places"));
  const std::string house = write("house.yaml", kHouse);
  const BenchmarkProtocol protocol =
      load_protocol(write("d.yaml", "tour: t.yaml\nsequence: [x]\nruns: [{name: q, boxs: []}]"));
  try {
    changed_world(house, protocol, protocol.runs[0]);
    FAIL() << "an unknown key must be refused";
  } catch (const UserError& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("d.yaml"), HasSubstr("'q'"), HasSubstr("did you mean 'boxes'")));
  }
}

}  // namespace
}  // namespace knav
