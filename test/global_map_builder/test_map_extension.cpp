#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>

#include "core/error.h"
#include "core/file_io.h"
#include "flat_drive.h"
#include "global_map_builder/closure_list.h"
#include "global_map_builder/map_report.h"

namespace knav {
namespace {

using namespace flat_world;

MapBuilderConfig small_config() {
  MapBuilderConfig config;
  config.closures.min_path_m = 8.0;
  return config;
}

Route route(const std::vector<Point2>& points, const std::vector<Wall>& walls) {
  Route route;
  route.walls = walls;
  route.truth = drive_through(points);
  route.odometry = drifting_odometry(route.truth);
  return route;
}

/// The ring without its cupboard at (7, 1), with a box put at (4.8, -1.5).
std::vector<Wall> rearranged() {
  std::vector<Wall> walls;
  add_box(-1.5, -1.5, 12.5, 8.5, &walls);
  add_box(1.5, 1.5, 9.5, 5.5, &walls);
  add_box(3.0, -1.5, 4.2, -1.0, &walls);
  add_box(12.0, 2.0, 12.5, 3.5, &walls);
  add_box(8.0, 8.0, 8.6, 8.5, &walls);
  add_box(4.0, 5.5, 5.5, 5.8, &walls);
  add_box(-1.5, 3.0, -1.1, 3.3, &walls);
  add_box(5.6, -1.5, 6.2, -1.0, &walls);
  return walls;
}

/// Begins at the far corner, comes round the other way and drives the lower corridor in both directions.
const std::vector<Point2> kSecond = {{11.0, 7.0}, {11.0, 0.0}, {0.0, 0.0}, {10.0, 0.2}};

struct TwoMaps {
  Route first = once_round_and_a_bit();
  Route second = route(kSecond, rearranged());
  BuiltMap before, after;

  TwoMaps() {
    MapBuilder builder(small_config(), small_mapper());
    feed(first, {}, &builder);
    before = builder.build();
    MapBuilder further(small_config(), small_mapper());
    further.extend(before.record, before.map);
    further.begin_drive("second.bag");
    feed(second, {}, &further, 5000.0);
    after = further.build();
  }
};
/// Built once; if that fails, every test that needs it fails at once.
const TwoMaps& two_maps() {
  static const auto maps = []() -> std::unique_ptr<TwoMaps> {
    try {
      return std::make_unique<TwoMaps>();
    } catch (const std::exception& error) {
      ADD_FAILURE() << error.what();
      return nullptr;
    }
  }();
  if (!maps) throw std::runtime_error("the maps could not be built");
  return *maps;
}

TEST(MapExtension, ADriveThatBeganElsewhereIsFoundInTheOldMap) {
  const TwoMaps& maps = two_maps();
  for (const auto& [i, where] : {std::pair<std::size_t, Pose2>{0, maps.second.truth.front()},
                                 {maps.second.truth.size() - 1, maps.second.truth.back()}}) {
    // The map's frame is the world's, since the first drive began at (0, 0, 0).
    const Pose2 pose = maps.after.map.trajectory[maps.first.truth.size() + i].T_map_robot;
    EXPECT_LT(distance_m(pose, where), 0.2) << "pose " << i;
    EXPECT_LT(std::fabs(normalize_angle_rad(pose.yaw_rad - where.yaw_rad)), 0.04) << "pose " << i;
  }
  EXPECT_EQ(maps.after.old_drives, 1);
  EXPECT_EQ(maps.after.record.drives.size(), 2u);
}

TEST(MapExtension, TheOldFrameStays) {
  const TwoMaps& maps = two_maps();
  const auto& before = maps.before.record.T_map_keyframe;
  for (std::size_t i = 0; i < before.size(); ++i) {
    ASSERT_EQ(distance_m(before[i], maps.after.record.T_map_keyframe[i]), 0.0);
    ASSERT_EQ(before[i].yaw_rad, maps.after.record.T_map_keyframe[i].yaw_rad);
  }
}

TEST(MapExtension, WhatWentGoesAndWhatCameIsThere) {
  const TwoMaps& maps = two_maps();
  const auto value = [](const BuiltMap& built, double x, double y) {
    const GridGeometry& g = built.map.occupancy.geometry;
    int highest = -1;
    for (int dy = -2; dy <= 2; ++dy) {
      for (int dx = -2; dx <= 2; ++dx) {
        highest =
            std::max<int>(highest, built.map.occupancy.value[g.index(g.cell_x(x) + dx, g.cell_y(y) + dy)]);
      }
    }
    return highest;
  };
  EXPECT_EQ(value(maps.before, 7.25, 1.0), 100);
  EXPECT_EQ(value(maps.after, 7.25, 1.0), 0) << "the cupboard's front is gone";
  EXPECT_EQ(value(maps.before, 5.9, -1.0), 0);
  EXPECT_EQ(value(maps.after, 5.9, -1.0), 100) << "the box's front is there";
  bool went = false, came = false;
  for (const MapChange& c : maps.after.changes) {
    went = went || (!c.occupied && std::hypot(c.x_m - 7.25, c.y_m - 1.1) < 0.5);
    came = came || (c.occupied && std::hypot(c.x_m - 5.9, c.y_m + 1.1) < 0.5);
    EXPECT_LT(std::min(std::hypot(c.x_m - 7.25, c.y_m - 1.2), std::hypot(c.x_m - 5.9, c.y_m + 1.2)), 1.0)
        << "nothing else changed: (" << c.x_m << ", " << c.y_m << ")";
  }
  EXPECT_TRUE(went);
  EXPECT_TRUE(came);
}

TEST(MapExtension, AnotherBuildingIsRefused) {
  std::vector<Wall> walls;
  add_box(-1.0, -1.0, 7.0, 5.0, &walls);
  add_box(1.0, 1.0, 2.4, 3.0, &walls);
  add_box(4.4, 2.0, 5.2, 5.0, &walls);
  const Route other = route({{0, 0}, {6, 0}, {6, 4}, {6, 0}, {0, 0}}, walls);
  MapBuilder builder(small_config(), small_mapper());
  builder.extend(two_maps().before.record, two_maps().before.map);
  builder.begin_drive("elsewhere.bag");
  feed(other, {}, &builder);
  try {
    builder.build();
    FAIL() << "was taken for the same building";
  } catch (const UserError& error) {
    EXPECT_NE(std::string(error.what()).find("elsewhere.bag: shares no place"), std::string::npos)
        << error.what();
  }
}

TEST(MapRecord, ReadsBackWhatWasWrittenToAMillimetre) {
  const std::string path = ::testing::TempDir() + "knav_drives.bin";
  const MapRecord& record = two_maps().after.record;
  write_map_record(path, record);
  const MapRecord again = read_map_record(path);
  ASSERT_EQ(again.drives.size(), 2u);
  ASSERT_EQ(again.T_map_keyframe.size(), record.T_map_keyframe.size());
  EXPECT_EQ(again.T_map_keyframe.back().x_m, record.T_map_keyframe.back().x_m);
  ASSERT_EQ(again.closures.size(), record.closures.size());
  EXPECT_EQ(again.closures.front().match.information, record.closures.front().match.information);
  EXPECT_EQ(again.drives[1].name, "second.bag");
  ASSERT_EQ(again.drives[1].frames.size(), record.drives[1].frames.size());
  const auto& a = std::get<DepthProfile>(record.drives[1].frames[40].data);
  const auto& b = std::get<DepthProfile>(again.drives[1].frames[40].data);
  ASSERT_EQ(a.z_m.size(), b.z_m.size());
  for (std::size_t i = 0; i < a.z_m.size(); ++i) {
    ASSERT_EQ(std::isnan(a.z_m[i]), std::isnan(b.z_m[i]));
    if (!std::isnan(a.z_m[i])) {
      ASSERT_NEAR(a.z_m[i], b.z_m[i], 0.00051);
    }
    ASSERT_EQ(a.height_class[i], b.height_class[i]);
  }

  std::string bytes = read_text_file(path);
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  write_text_atomically(path, bytes);
  EXPECT_THROW(read_map_record(path), UserError) << "one bit turned";
  write_text_atomically(path, bytes.substr(0, 10));
  EXPECT_THROW(read_map_record(path), UserError) << "cut off";
}

TEST(MapRecord, ScansKeepInfinityAndFarReadings) {
  MapRecord record;
  Drive& drive = record.drives.emplace_back();
  drive.keyframes.emplace_back();
  record.T_map_keyframe.emplace_back();
  RangeScan scan;
  scan.range_m = {1.25f, 80.0f, std::numeric_limits<float>::infinity(),
                  std::numeric_limits<float>::quiet_NaN()};
  drive.frames.push_back({1.0, 0.0, {}, {}, {}, scan});
  const std::string path = ::testing::TempDir() + "knav_scans.bin";
  write_map_record(path, record);
  const auto again = std::get<RangeScan>(read_map_record(path).drives[0].frames[0].data);
  EXPECT_NEAR(again.range_m[0], 1.25, 0.001);
  EXPECT_NEAR(again.range_m[1], 80.0, 0.001);
  EXPECT_TRUE(std::isinf(again.range_m[2]));
  EXPECT_TRUE(std::isnan(again.range_m[3]));
}

/// The ring again, its closures as a list.
BuiltMap build_with(const std::vector<ListedClosure>& list) {
  MapBuilder builder(small_config(), small_mapper());
  feed(two_maps().first, {}, &builder);
  builder.set_list(list);
  return builder.build();
}

TEST(ClosureList, DenyingEveryClosureLeavesTheDriftAndAllowingOneTakesItOut) {
  const BuiltMap& plain = two_maps().before;
  const std::string path = ::testing::TempDir() + "knav_closures.yaml";
  write_closure_list(path, plain.record);
  EXPECT_TRUE(read_closure_list(path).empty()) << "all are auto at first";

  const std::string written = read_text_file(path);
  std::string text = written;
  for (std::size_t at = 0; (at = text.find("verdict: auto", at)) != std::string::npos;)
    text.replace(at, 13, "verdict: deny");
  write_text_atomically(path, text);
  std::vector<ListedClosure> list = read_closure_list(path);
  ASSERT_EQ(list.size(), plain.record.closures.size());
  const BuiltMap denied = build_with(list);
  for (const Closure& listed : plain.record.closures) {
    for (const Closure& c : denied.record.closures) {
      if (c.from == listed.from && c.to == listed.to) {
        EXPECT_FALSE(c.accepted);
        EXPECT_EQ(c.reason, "denied by the list");
        EXPECT_EQ(c.verdict, "deny");
      }
    }
  }

  const auto accepted = std::find_if(plain.record.closures.begin(), plain.record.closures.end(),
                                     [](const Closure& c) { return c.accepted; });
  ASSERT_NE(accepted, plain.record.closures.end());
  // A wrong transform on purpose: what is allowed is not questioned. The others stay denied, or they would hold against it.
  ListedClosure& wrong = list[static_cast<std::size_t>(accepted - plain.record.closures.begin())];
  wrong.allow = true;
  wrong.T_from_to.x_m += 0.6;
  const BuiltMap forced = build_with(list);
  const auto& poses = forced.record.T_map_keyframe;
  const Pose2 made = poses[static_cast<std::size_t>(accepted->from)].inverse() *
                     poses[static_cast<std::size_t>(accepted->to)];
  EXPECT_LT(distance_m(made, wrong.T_from_to), 0.3) << "the map gives way to it";
  const auto kept = std::find_if(forced.record.closures.begin(), forced.record.closures.end(),
                                 [](const Closure& c) { return c.verdict == "allow"; });
  ASSERT_NE(kept, forced.record.closures.end());
  EXPECT_TRUE(kept->accepted);
}

TEST(ClosureList, FaultsNameTheEntry) {
  ListedClosure unknown;
  unknown.from_stamp_s = 1.0;
  unknown.to_stamp_s = 2.0;
  unknown.where = "my.yaml: closure 1";
  try {
    build_with({unknown});
    FAIL();
  } catch (const UserError& error) {
    EXPECT_NE(std::string(error.what()).find("my.yaml: closure 1: there is no keyframe at 1.000 s"),
              std::string::npos)
        << error.what();
  }
  const std::string path = ::testing::TempDir() + "knav_bad_closures.yaml";
  const auto fault_of = [&](const std::string& text) {
    write_text_atomically(path, text);
    try {
      read_closure_list(path);
    } catch (const UserError& error) {
      return std::string(error.what());
    }
    return std::string("none");
  };
  EXPECT_NE(fault_of("closures: [{from_stamp_s: 1, to_stamp_s: 2, verdict: perhaps}]").find("'perhaps'"),
            std::string::npos);
  EXPECT_NE(fault_of("closures: [{from_stamp_s: 1, verdict: deny}]").find("'to_stamp_s'"), std::string::npos);
  EXPECT_NE(fault_of("closures: [{from_stamp_s: 1, to_stamp_s: 2, verdict: allow}]").find("x_m"),
            std::string::npos);
  EXPECT_NE(fault_of("closures: [{form_stamp_s: 1, to_stamp_s: 2}]").find("'form_stamp_s'"),
            std::string::npos);
  EXPECT_NE(fault_of("[1, 2]").find("closures"), std::string::npos);
}

TEST(MapReport, HoldsPicturesReasonsAndTheList) {
  const BuiltMap& built = two_maps().after;
  const std::string path = ::testing::TempDir() + "knav_report.html";
  write_map_report(path, built, "Map of <two> drives", {{"path_m", "61"}});
  const std::string text = read_text_file(path);
  EXPECT_NE(text.find("Map of &lt;two&gt; drives"), std::string::npos);
  std::size_t pictures = 0;
  for (std::size_t at = 0; (at = text.find("data:image/png;base64,iVBORw0KGgo", at)) != std::string::npos;
       ++at)
    ++pictures;
  EXPECT_GE(pictures, 4u) << "before, after, changes and the closures', each a PNG by its first bytes";
  std::size_t rows = 0;
  for (std::size_t at = 0; (at = text.find("<tr class=", at)) != std::string::npos; ++at) ++rows;
  EXPECT_EQ(rows, built.record.closures.size());
  EXPECT_EQ(text.find("http"), std::string::npos) << "nothing is loaded from elsewhere";
}

TEST(MapChanges, CountWhatCameAndWentButNotWhatWasNeverSeen) {
  OccupancyGrid before;
  before.geometry.width_cells = before.geometry.height_cells = 60;
  before.value.assign(60 * 60, 0);
  OccupancyGrid now = before;
  const auto wall = [](OccupancyGrid* grid, int x, int y, int length, int value) {
    for (int i = 0; i < length; ++i)
      grid->value[grid->geometry.index(x + i, y)] = static_cast<std::int8_t>(value);
  };
  wall(&before, 5, 10, 40, 100);
  wall(&now, 5, 11, 40, 100);      // the same wall, a cell off
  wall(&before, 10, 30, 10, 100);  // 0.5 m that went
  wall(&now, 30, 40, 12, 100);     // 0.6 m that came
  wall(&now, 50, 50, 2, 100);      // too short
  for (int y = 50; y < 60; ++y) wall(&before, 0, y, 20, -1);
  wall(&now, 4, 54, 10, 100);  // into the unknown
  const std::vector<MapChange> changes = find_changes(before, now, 0.15, 0.3);
  ASSERT_EQ(changes.size(), 2u);
  EXPECT_TRUE(changes[0].occupied);
  EXPECT_NEAR(changes[0].wall_m, 0.6, 1e-9);
  EXPECT_NEAR(changes[0].x_m, 36 * 0.05, 1e-9);
  EXPECT_NEAR(changes[0].y_m, 40.5 * 0.05, 1e-9);
  EXPECT_FALSE(changes[1].occupied);
  EXPECT_NEAR(changes[1].wall_m, 0.5, 1e-9);
  EXPECT_NEAR(changes[1].x_m, 15 * 0.05, 1e-9);
}

}  // namespace
}  // namespace knav
