#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "kinect_sim/collision_map.h"
#include "kinect_sim/simulator.h"
#include "kinect_sim/tour.h"
#include "kinect_sim/world.h"

namespace knav {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string fault_of(const std::string& text) {
  try {
    parse_world(text, "house.yaml");
  } catch (const UserError& error) {
    return error.what();
  }
  return "no fault";
}

TEST(World, AnUnknownKeyIsRefusedWithFileAndTheKeyMeant) {
  EXPECT_THAT(fault_of("wals: []"),
              AllOf(HasSubstr("house.yaml"), HasSubstr("'wals'"), HasSubstr("did you mean 'walls'")));
  EXPECT_THAT(fault_of("boxes: [{at: [0, 3], size: [1, 1, 1], colour: red}]"),
              AllOf(HasSubstr("house.yaml"), HasSubstr("boxes[0]/colour")));
}

TEST(World, ContradictionsAreRefusedInWords) {
  EXPECT_THAT(fault_of("name: a\nname: b"), HasSubstr("'name' is given twice"));
  EXPECT_THAT(fault_of("rooms: [{x: [3, 1], y: [0, 1]}]"), AllOf(HasSubstr("rooms[0]/x"), HasSubstr("rise")));
  EXPECT_THAT(fault_of("walls: [{points: [[1, 1], [1, 1]]}]"), HasSubstr("walls[0]"));
  EXPECT_THAT(fault_of("walls: [{points: [[2, 0], [2, 5]], openings: [{at: [2, 4.8], width_m: 1}]}]"),
              HasSubstr("beyond the wall's end"));
  EXPECT_THAT(fault_of("walls: [{points: [[2, 0], [2, 5]], openings: [{at: [2, 2]}, {at: [2, 2.5]}]}]"),
              HasSubstr("overlaps"));
  EXPECT_THAT(fault_of("walls: [{points: [[2, 0], [2, 5]], openings: [{at: [3, 2]}]}]"),
              HasSubstr("off the wall"));
  EXPECT_THAT(fault_of("low_obstacles: [{at: [3, 3], size: [1, 1, 0.6]}]"), HasSubstr("boxes"));
  EXPECT_THAT(fault_of("boxes: [{at: [3, 3], size: [1, 1, 1], appears_s: 5, disappears_s: 4}]"),
              HasSubstr("disappears_s"));
  EXPECT_THAT(fault_of("boxes: [{at: [0, 0], size: [1, 1, 1]}]"),
              AllOf(HasSubstr("'spawn'"), HasSubstr("obstacle")));
  EXPECT_THAT(fault_of("boxes: [{at: [3, 0], size: [1, 1, 1]}]\nplaces: {desk: [3, 0, 0]}"),
              HasSubstr("places/desk"));
  EXPECT_THAT(fault_of("people: [{name: Ann}]"), AllOf(HasSubstr("people[0]/path")));
  EXPECT_THAT(fault_of("boxes: [{at: [0, .nan], size: [1, 1, 1]}]"), HasSubstr("not finite"));
  EXPECT_THAT(fault_of("walls: 3"), AllOf(HasSubstr("'walls'"), HasSubstr("list")));
  EXPECT_THAT(fault_of("walls: [{points: [[0"), AllOf(HasSubstr("house.yaml"), HasSubstr("line")));
  EXPECT_THAT(fault_of("occupancy: {image: none.png, resolution_m: 0.05}"), HasSubstr("none.png"));
}

/// A base with a table, a box and a door, and one run's changes on top of it.
WorldConfig changed(const std::string& changes) {
  const std::string folder = testing::TempDir();
  std::ofstream(folder + "changes_base.yaml")
      << "tables: [{at: [3, 0], size: [1.0, 0.6]}]\n"
         "boxes: [{at: [0, 3], size: [0.4, 0.2, 1.0]}]\n"
         "doors: [{name: kitchen, hinge: [5, 0], to: [5, 1], open_deg: 90}]\n";
  return parse_world("base: changes_base.yaml\n" + changes, "run.yaml", folder);
}

std::string fault_of_changes(const std::string& changes) {
  try {
    changed(changes);
  } catch (const UserError& error) {
    return error.what();
  }
  return "no fault";
}

TEST(WorldChanges, AMovedPieceStandsWhereItWasPutAndNowhereElse) {
  const WorldConfig world = changed("moved: [{from: [0, 3], to: [-2, 4, 90]}]");
  const CollisionMap map(world, 1.0);
  EXPECT_GT(map.clearance_m({0, 3}), 0.7);
  EXPECT_EQ(map.clearance_m({-2, 4}), 0.0);
  // Turned by 90 degrees: 0.1 m to each side of x = -2, 0.2 m of y = 4.
  EXPECT_NEAR(map.clearance_m({-1.8, 4}), 0.1, 1e-9);
  EXPECT_NEAR(map.clearance_m({-2, 4.3}), 0.1, 1e-9);
}

TEST(WorldChanges, ARemovedTableTakesItsLegsAlongAndLeavesTheRest) {
  const WorldConfig before = changed("");
  const WorldConfig world = changed("removed: [[3, 0]]\nmoved: [{from: [0, 3], to: [0, 4, 0]}]");
  EXPECT_EQ(before.solids.size(), 6u) << "a box, a table top and four legs";
  EXPECT_EQ(world.solids.size(), 1u);
  const CollisionMap map(world, 1.0);
  EXPECT_GT(map.clearance_m({3, 0}), 0.7);
  EXPECT_EQ(map.clearance_m({0, 4}), 0.0);
}

TEST(WorldChanges, ADoorOfTheBaseIsClosedByItsName) {
  const WorldConfig world =
      changed("door_states: [{name: kitchen, open_deg: 0, schedule: [{at_s: 10, open_deg: 90}]}]");
  ASSERT_EQ(world.doors.size(), 1u);
  EXPECT_EQ(door_open_at(world.doors[0], 5.0), 0.0);
  EXPECT_NEAR(door_open_at(world.doors[0], 20.0), 1.5708, 1e-4);
}

TEST(WorldChanges, ChangesOfWhatIsNotThereAreRefusedWithTheNearest) {
  EXPECT_THAT(fault_of_changes("removed: [[1, 3]]"), AllOf(HasSubstr("run.yaml"), HasSubstr("[0, 3]")));
  EXPECT_THAT(fault_of_changes("moved: [{from: [9, 9], to: [1, 1, 0]}]"), HasSubstr("moved[0]/from"));
  EXPECT_THAT(fault_of_changes("door_states: [{name: kitchn, open_deg: 0}]"),
              HasSubstr("did you mean 'kitchen'"));
  EXPECT_THAT(fault_of("removed: [[3, 0]]"), HasSubstr("none at all"));
}

TEST(World, AnOpeningLeavesAGapUnderItsLintel) {
  const WorldConfig world = parse_world(
      "walls: [{points: [[2, -2], [2, 2]], thickness_m: 0.1, openings: [{at: [2, 0], width_m: 1.0, frame: "
      "false}]}]",
      "w");
  ASSERT_EQ(world.solids.size(), 3u);  // two pieces and the lintel
  const CollisionMap map(world, 1.0);
  EXPECT_NEAR(map.clearance_m({2, 0}), 0.5, 1e-9);
  EXPECT_NEAR(map.clearance_m({2, 0.75}), 0.0, 1e-9);
  EXPECT_NEAR(map.clearance_m({1.5, 1.0}), 0.45, 1e-9);
}

TEST(World, AnOccupancyImageBecomesWallsTheRightWayUp) {
  const std::string directory = testing::TempDir();
  cv::Mat image(20, 40, CV_8UC1, cv::Scalar(254));
  image.at<std::uint8_t>(0, 5) = 0;  // top row: the highest y
  for (int u = 10; u < 20; ++u) image.at<std::uint8_t>(15, u) = 0;
  for (int u = 10; u < 20; ++u) image.at<std::uint8_t>(16, u) = 0;
  cv::imwrite(directory + "/plan.png", image);
  const WorldConfig world = parse_world(
      "occupancy: {image: plan.png, resolution_m: 0.5, origin: [-10, -20], height_m: 2}\nspawn: [9, -11, 0]",
      "w", directory);
  ASSERT_EQ(world.solids.size(), 2u);  // runs and equal rows are joined
  const CollisionMap map(world, 1.0);
  EXPECT_NEAR(map.clearance_m({-10 + 5.5 * 0.5, -20 + 19.5 * 0.5}), 0.0, 1e-9);
  EXPECT_NEAR(map.clearance_m({-10 + 15 * 0.5, -20 + 4 * 0.5}), 0.0, 1e-9);  // between rows 15 and 16
  EXPECT_NEAR(map.clearance_m({-10 + 15 * 0.5, -20 + 5 * 0.5 + 0.3}), 0.3,
              1e-9);  // above row 15's upper edge
}

TEST(World, OfAMapServersImageWhatNobodySawIsSolidUnlessAskedOtherwise) {
  const std::string directory = testing::TempDir();
  cv::Mat image(20, 20, CV_8UC1, cv::Scalar(205));
  image(cv::Rect(5, 5, 10, 10)).setTo(254);
  image.at<std::uint8_t>(10, 10) = 206;  // hardly seen, and free by map_server's free_thresh
  cv::imwrite(directory + "/seen.png", image);
  const std::string text = "occupancy: {image: seen.png, resolution_m: 0.5";
  const CollisionMap solid(parse_world(text + "}\nspawn: [5, 5, 0]", "w", directory), 1.0);
  EXPECT_NEAR(solid.clearance_m({2.9, 5.0}), 0.4, 1e-9);
  EXPECT_GT(solid.clearance_m({5.25, 4.75}), 0.5);
  EXPECT_NEAR(solid.clearance_m({1.0, 1.0}), 0.0, 1e-9);
  const WorldConfig open = parse_world(text + ", occupied_below: 100}\nspawn: [5, 5, 0]", "w", directory);
  EXPECT_TRUE(open.solids.empty());
  // A start in what is solid is refused where a robot is to be driven, and not where one is looked for.
  std::ofstream(directory + "/seen.yaml") << text << "}\nspawn: [1, 1, 0]\n";
  EXPECT_THROW(load_world(directory + "/seen.yaml"), UserError);
  EXPECT_EQ(load_world(directory + "/seen.yaml", StartMustBe::kAnywhere).spawn.x_m, 1.0);
}

TEST(World, ABaseWorldIsTakenOverAndAddedTo) {
  const std::string directory = testing::TempDir();
  std::ofstream(directory + "/base.yaml") << "places: {a: [1, 0, 0]}\nwalls: [{points: [[3, -1], [3, 1]]}]\n";
  const WorldConfig world =
      parse_world("base: base.yaml\npeople: [{name: Ann, path: [[0, 2]]}]", "w", directory);
  EXPECT_EQ(world.solids.size(), 1u);
  EXPECT_EQ(world.people.size(), 1u);
  EXPECT_EQ(world.places.count("a"), 1u);
}

TEST(World, EveryShippedWorldAndTourLoads) {
  int worlds = 0, tours = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(KINECT_NAV_SOURCE_DIR) + "/config/worlds")) {
    const std::string path = entry.path().string();
    if (path.find("_changes.yaml") != std::string::npos) continue;  // the benchmark's
    if (path.find("_tour.yaml") != std::string::npos) {
      EXPECT_NO_THROW(load_tour(path)) << path;
      ++tours;
    } else if (entry.path().extension() == ".yaml") {
      EXPECT_NO_THROW(load_world(path)) << path;
      ++worlds;
    }
  }
  EXPECT_GE(worlds, 3);
  EXPECT_GE(tours, 2);
}

TEST(TourScript, FaultsNameFileAndKey) {
  const auto fault = [](const char* text) -> std::string {
    try {
      parse_tour(text, "tour.yaml");
    } catch (const UserError& error) {
      return error.what();
    }
    return "no fault";
  };
  EXPECT_THAT(fault("steps: [{drvie: [[0, 0]]}]"),
              AllOf(HasSubstr("tour.yaml"), HasSubstr("steps[0]/drvie")));
  EXPECT_THAT(fault("steps: [{wait: 1, mark: a}]"), HasSubstr("exactly one"));
  EXPECT_THAT(fault("speed_mps: 0.5"), HasSubstr("steps"));
}

}  // namespace
}  // namespace knav
