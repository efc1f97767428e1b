#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>

#include "brin_benchmark/direction_watch.h"
#include "brin_benchmark/goal_session.h"
#include "brin_benchmark/protocol.h"
#include "core/error.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

using testing::HasSubstr;

/// Two rooms with a door between them, a table, a low box, stairs and a glass screen.
const char* const kHouse = R"(
name: house
spawn: [1, 1, 0]
walls:
  - points: [[0, 0], [12, 0], [12, 6], [0, 6], [0, 0]]
  - points: [[7, 0], [7, 6]]
    openings: [{at: [7, 3]}]
doors:
  - {name: middle, hinge: [7, 2.57], to: [7, 3.43], open_deg: 90}
tables:
  - {at: [3, 4], size: [1.2, 0.8]}
low_obstacles:
  - {at: [4.5, 1.5], size: [0.3, 0.3, 0.06]}
glass:
  - {from: [2, 2.4], to: [3, 2.4], height_m: 1.1}
stairs_down:
  - {min: [5.2, 4.8], max: [6.4, 5.6], direction: '+x'}
)";

/// The map as it would be had the robot seen everything.
MapDirectory true_map(const WorldConfig& world) {
  MapDirectory map;
  OccupancyGrid& grid = map.occupancy;
  grid.geometry = {260, 140, 0.05, -1.5, -1.5};
  grid.value.assign(grid.geometry.cell_count(), -1);
  for (int iy = 0; iy < 140; ++iy) {
    for (int ix = 0; ix < 260; ++ix) {
      const Point2 p = world.spawn * Point2{grid.geometry.center_x_m(ix), grid.geometry.center_y_m(iy)};
      if (p.x_m < 0 || p.x_m > 12 || p.y_m < 0 || p.y_m > 6) continue;
      bool occupied = false;
      for (const Solid& s : world.solids) occupied = occupied || (s.material != Material::kGlass && footprint_distance_m(s, p) < 0.03);
      grid.value[grid.geometry.index(ix, iy)] = occupied ? 100 : 0;
    }
  }
  return map;
}

GoalSuiteConfig small_suite() {
  GoalSuiteConfig config;
  config.runs = 2;
  config.goals = 16;
  config.kidnaps = 3;
  config.people = 4;
  config.shortest_way_m = 2.0;
  return config;
}

TEST(Goals, ReachableOnesCanBeReachedInTheChangedBuildingAndOthersCannot) {
  const WorldConfig world = parse_world(kHouse, "house.yaml");
  MapDirectory map = true_map(world);
  const WorldInMap world_in_map(world, map, world.spawn);
  paint_keepout(world, world_in_map, &map);
  const std::vector<SuiteRun> suite = draw_goals(world, map, world_in_map, small_suite());
  ASSERT_EQ(suite.size(), 2u);
  const std::string house = testing::TempDir() + "goals_house.yaml";
  std::ofstream(house) << kHouse;
  BenchmarkProtocol protocol;
  protocol.file = house;
  std::map<std::string, int> kinds;
  int kidnaps = 0, all = 0;
  for (const SuiteRun& run : suite) {
    const WorldConfig changed = changed_world(house, protocol, {run.name, run.changes});
    EXPECT_EQ(changed.people.size(), 4u);
    WorldConfig in_the_end = changed;
    for (const TimedSolid& timed : changed.timed_solids) in_the_end.solids.push_back(timed.solid);
    for (DoorConfig& door : in_the_end.doors) door.open_rad = door_open_at(door, 1e6);
    in_the_end.timed_solids.clear();
    const FloorPlan plan(in_the_end, 0.2);
    for (const SuiteGoal& goal : run.goals) {
      ++kinds[goal.kind];
      ++all;
      kidnaps += goal.kidnap ? 1 : 0;
      const Point2 p{goal.T_world_goal.x_m, goal.T_world_goal.y_m};
      EXPECT_EQ(plan.connected({p}, {}), goal.expected == Expected::kReached) << run.name << ", " << goal.kind;
      if (goal.kidnap) {
        EXPECT_TRUE(plan.connected({{goal.T_world_kidnap.x_m, goal.T_world_kidnap.y_m}}, {}));
      }
    }
  }
  EXPECT_EQ(all, 19);
  EXPECT_EQ(kidnaps, 3);
  EXPECT_EQ(kinds["closed room"], 2) << "the house has a door that is the only way";
  for (const char* kind : {"floor", "wall", "keepout"}) EXPECT_GT(kinds[kind], 0) << kind;
  EXPECT_GT(kinds["table edge"] + kinds["low box"] + kinds["stairs"] + kinds["glass"], 4);
  EXPECT_EQ(to_json(draw_goals(world, map, world_in_map, small_suite())), to_json(suite)) << "the same seed, the same goals";
  EXPECT_EQ(to_json(suite_from_json(to_json(suite), "suite.json")), to_json(suite));
}

TEST(Goals, NothingIsPutOnThePlacesOfTheWorldReachableOrNot) {
  const std::string text = std::string(kHouse) + "places:\n  near_table: [3, 3.3, 0]\n  beside_table: [4, 4, 0]\n  other_room: [10, 3, 0]\n";
  const WorldConfig world = parse_world(text, "house.yaml");
  const MapDirectory map = true_map(world);
  const WorldInMap world_in_map(world, map, world.spawn);
  const std::string house = testing::TempDir() + "goals_places.yaml";
  std::ofstream(house) << text;
  BenchmarkProtocol protocol;
  protocol.file = house;
  GoalSuiteConfig config = small_suite();
  config.runs = 3;
  for (config.seed = 1; config.seed <= 12; ++config.seed) {
    for (const SuiteRun& run : draw_goals(world, map, world_in_map, config)) {
      EXPECT_NO_THROW(changed_world(house, protocol, {run.name, run.changes})) << config.seed << ", " << run.name;
    }
  }
}

TEST(Goals, GlassAndStairsArePaintedIntoTheKeepoutMask) {
  const WorldConfig world = parse_world(kHouse, "house.yaml");
  MapDirectory map = true_map(world);
  paint_keepout(world, WorldInMap(world, map, world.spawn), &map);
  const auto masked = [&](double x, double y) {
    const Point2 m = world.spawn.inverse() * Point2{x, y};
    const GridGeometry& g = map.keepout.geometry;
    return map.keepout.value[g.index(g.cell_x(m.x_m), g.cell_y(m.y_m))] == 100;
  };
  EXPECT_TRUE(masked(2.5, 2.4));
  EXPECT_TRUE(masked(5.8, 5.2));
  EXPECT_FALSE(masked(2.5, 3.0));
  EXPECT_FALSE(masked(4.5, 1.5)) << "a low box is seen";
}

TEST(Goals, APlaceIsWhereTheWallsRoundItAreInTheMapThoughTheMapIsOffThere) {
  const WorldConfig world = parse_world(kHouse, "house.yaml");
  const MapDirectory map = true_map(world);
  const Pose2 T_world_map = world.spawn * Pose2{0.31, -0.22, 0.03};  // what a bent map's beginning says of this place
  const WorldInMap world_in_map(world, map, T_world_map);
  for (const Point2& place : {Point2{2.5, 2.4}, Point2{5.8, 5.2}, Point2{4.5, 1.5}}) {
    const Point2 found = world_in_map * place, truth = world.spawn.inverse() * place;
    EXPECT_NEAR(found.x_m, truth.x_m, 0.05) << place.x_m;
    EXPECT_NEAR(found.y_m, truth.y_m, 0.05) << place.x_m;
    const Point2 back = world_in_map.in_world(found);
    EXPECT_NEAR(back.x_m, place.x_m, 0.05);
    EXPECT_NEAR(back.y_m, place.y_m, 0.05);
  }
}

TEST(DirectionWatch, CountsWhoTurnsRoundOrSwaysAndNotWhoTurnsACorner) {
  const auto drive = [](DirectionWatch* watch, Pose2* at, double v, double w, double seconds) {
    for (double t = 0.0; t < seconds; t += 0.1) {
      at->yaw_rad = normalize_angle_rad(at->yaw_rad + 0.1 * w);
      at->x_m += 0.1 * v * std::cos(at->yaw_rad);
      at->y_m += 0.1 * v * std::sin(at->yaw_rad);
      watch->add(*at);
    }
  };
  DirectionWatch watch;
  Pose2 at;
  watch.start(at);
  drive(&watch, &at, 0.0, 0.5, 2.0 * kPi / 0.5);  // looks round once
  drive(&watch, &at, 0.5, 0.0, 5.0);
  drive(&watch, &at, 0.4, 0.8, 2.0);  // a corner
  drive(&watch, &at, 0.5, 0.0, 5.0);
  EXPECT_EQ(watch.reversals(), 0);
  drive(&watch, &at, 0.0, 1.0, 3.1);
  drive(&watch, &at, 0.5, 0.0, 2.0);
  EXPECT_EQ(watch.turned_round(), 1);
  drive(&watch, &at, -0.2, 0.0, 3.0);
  EXPECT_EQ(watch.turned_round(), 2) << "backing up is a reversal";
  EXPECT_EQ(watch.sways(), 0);
  for (int i = 0; i < 3; ++i) {
    drive(&watch, &at, 0.0, 1.0, 1.5);
    drive(&watch, &at, 0.0, -1.0, 1.5);
  }
  EXPECT_EQ(watch.sways(), 5);
}

GoalResult result_of(Expected expected, bool reached, double time_s, double distance_m) {
  GoalResult r;
  r.goal.expected = expected;
  r.goal.kind = "floor";
  r.reached = reached;
  r.time_s = time_s;
  r.distance_m = distance_m;
  return r;
}

TEST(GoalScore, WhoArrivesElsewhereHasNotArrived) {
  GoalResult far = result_of(Expected::kReached, true, 20.0, 10.0), near = far;
  near.true_off_m = 0.4;  // what a built map may be off
  far.true_off_m = 12.2;
  near.doubt_arrival();
  far.doubt_arrival();
  EXPECT_TRUE(near.right());
  EXPECT_FALSE(far.right());
  EXPECT_THAT(far.reason, HasSubstr("12.2 m"));
}

TEST(GoalScore, SpeedIsOfReachedGoalsReversalsOfAllAndKidnapsAreCountedApart) {
  GoalRunResult run;
  run.goals.push_back(result_of(Expected::kReached, true, 20.0, 10.0));
  run.goals.back().sways = 1;
  run.goals.push_back(result_of(Expected::kReached, false, 60.0, 5.0));
  run.goals.back().turned_round = 3;
  run.goals.push_back(result_of(Expected::kBlocked, false, 70.0, 8.0));
  run.goals.back().failure_code = static_cast<int>(FailureCode::kBlocked);
  run.goals.back().came_near_s = 25.0;
  run.goals.push_back(result_of(Expected::kOccupied, false, 0.1, 0.0));
  run.goals.back().failure_code = static_cast<int>(FailureCode::kNoPath);
  run.goals.push_back(result_of(Expected::kReached, true, 100.0, 30.0));
  run.goals.back().goal.kidnap = true;
  run.goals.back().carried_off = true;
  run.goals.back().recovery = {2.0, 38.0, 0.5};
  run.goals.back().localization = {100.0, 60.0, 10.0, 30.0, 0.0, 0.5};
  const GoalScore s = score({run});
  EXPECT_EQ(s.goals, 4);
  EXPECT_EQ(s.reachable, 2);
  EXPECT_EQ(s.reached, 1);
  EXPECT_EQ(s.unreachable, 2);
  EXPECT_EQ(s.right, 1) << "no path is not what is wrong with a goal in a wall";
  EXPECT_EQ(s.right_in_time, 0) << "70 s";
  EXPECT_DOUBLE_EQ(s.given_up_max_s, 70.0);
  EXPECT_DOUBLE_EQ(s.given_up_after_near_max_s, 45.0);
  EXPECT_EQ(s.kidnapped, 1);
  EXPECT_EQ(s.found_again, 1);
  EXPECT_EQ(s.noticed, 1);
  EXPECT_EQ(s.localized_again, 1);
  EXPECT_DOUBLE_EQ(s.localization.ok_wrong_s, 0.5);
  EXPECT_DOUBLE_EQ(s.speed_mps, 0.5);
  EXPECT_DOUBLE_EQ(s.reversals_per_20s, 20.0 * 4 / 80.0);
  EXPECT_EQ(to_json(goal_run_from_json(to_json(run), "run_01.json")), to_json(run));
  EXPECT_THAT(goal_report_markdown({run}, {"a test"}), HasSubstr("1 of 2 (50.0 %)"));
}

TEST(KidnapWatch, NoticedIsNotOkInTimeAndRightIsOkAndNear) {
  KidnapWatch watch(100.0);
  const auto say = [&](double stamp_s, LocalizationVerdict verdict, double error_m) {
    Moment m;
    m.stamp_s = stamp_s;
    m.dt_s = 0.1;
    m.has_pose = true;
    m.verdict = verdict;
    m.error_m = error_m;
    watch.add(m);
  };
  say(101.0, LocalizationVerdict::kOk, 9.0);
  EXPECT_EQ(watch.recovery().ok_wrong_s, 0.0) << "forgiven for 5 s";
  say(106.0, LocalizationVerdict::kOk, 9.0);
  EXPECT_DOUBLE_EQ(watch.recovery().ok_wrong_s, 0.1);
  say(107.0, LocalizationVerdict::kUncertain, 9.0);
  EXPECT_FALSE(watch.recovery().noticed()) << "after 7 s";
  EXPECT_DOUBLE_EQ(watch.recovery().noticed_s, 7.0);
  say(108.0, LocalizationVerdict::kUncertain, 0.1);
  EXPECT_FALSE(watch.recovery().right()) << "near, but it does not say so";
  say(109.0, LocalizationVerdict::kOk, 0.31);
  EXPECT_FALSE(watch.recovery().right());
  say(141.0, LocalizationVerdict::kOk, 0.1);
  EXPECT_FALSE(watch.recovery().right()) << "too late";
  say(139.0, LocalizationVerdict::kOk, 0.1);
  EXPECT_DOUBLE_EQ(watch.recovery().right_s, 39.0);
}

TEST(GoalSession, DrivesGoalsInASmallRoomAndASecondSessionDrivesNothingAgain) {
  const std::string folder = testing::TempDir() + "goal_session";
  fs::remove_all(folder);
  fs::create_directories(folder);
  std::ofstream(folder + "/room.yaml") << R"(
name: room
wall_height_m: 2.5
spawn: [0, 0, 0]
walls:
  - points: [[-1.5, -2], [4.5, -2], [4.5, 2], [-1.5, 2], [-1.5, -2]]
boxes:
  - {name: crate, at: [1.6, -1.4], size: [0.8, 0.6, 0.8]}
  - {name: shelf, at: [4.2, 1.0], size: [0.4, 1.2, 1.8]}
)";
  std::ofstream(folder + "/tour.yaml") << "speed_mps: 0.6\nturn_radps: 0.9\nsteps:\n  - drive: [[2.8, 0.0]]\n  - face: 180\n  - drive: [[0.0, "
                                          "0.0]]\n  - face: 0\n";
  GoalSessionOptions options;
  options.world = folder + "/room.yaml";
  options.tour = folder + "/tour.yaml";
  options.out = folder + "/out";
  options.suite.runs = 1;
  options.suite.goals = 2;
  options.suite.kidnaps = 0;
  options.suite.people = 1;
  options.suite.shortest_way_m = 1.0;
  const auto quiet = [](const std::string&, double, const std::string&) {};
  {
    GoalSession session(options);
    session.map(quiet);
    session.run({}, quiet);
  }
  const std::vector<GoalRunResult> runs = read_goal_results(options.out);
  ASSERT_EQ(runs.size(), 1u);
  ASSERT_EQ(runs[0].goals.size(), 2u);
  for (const GoalResult& r : runs[0].goals) {
    EXPECT_TRUE(r.right()) << r.goal.kind << ": " << r.reason;
    EXPECT_EQ(r.collisions, 0);
    EXPECT_EQ(r.moved_after_mps, 0.0);
    if (r.reached) {
      EXPECT_LT(r.estimate_off_m, 0.07) << "tolerance 0.05 m, and the localizer's last word";
    }
  }
  int stages = 0;
  GoalSession again(options);
  const auto count = [&](const std::string&, double, const std::string&) { ++stages; };
  again.map(count);
  again.run({}, count);
  EXPECT_EQ(stages, 0) << "all of it was there";
  options.suite.seed = 2;
  EXPECT_THROW(GoalSession{options}, UserError);
  fs::remove_all(folder);
}

}  // namespace
}  // namespace knav
