#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/distance_transform.h"
#include "core/error.h"
#include "core/surface_code.h"
#include "planner_tracker/combined_map.h"
#include "toy_world.h"

namespace knav {
namespace {

TEST(Overlay, EveryCombinationOfGlobalAndLocal) {
  using S = CellState;
  const struct {
    S global, local, combined;
  } table[] = {
      {S::kUnknown, S::kUnknown, S::kUnknown},
      {S::kUnknown, S::kFree, S::kFree},
      {S::kUnknown, S::kOccupied, S::kOccupied},
      {S::kFree, S::kUnknown, S::kFree},
      {S::kFree, S::kFree, S::kFree},
      {S::kFree, S::kOccupied, S::kOccupied},
      {S::kOccupied, S::kUnknown, S::kOccupied},
      {S::kOccupied, S::kFree, S::kFree},
      {S::kOccupied, S::kOccupied, S::kOccupied},
      {S::kKeepout, S::kUnknown, S::kKeepout},
      {S::kKeepout, S::kFree, S::kKeepout},
      {S::kKeepout, S::kOccupied, S::kKeepout},
  };
  for (const auto& row : table) EXPECT_EQ(overlay(row.global, row.local), row.combined);
  // The same through the grids: one cell a row of the table.
  OccupancyGrid global, keepout, local;
  global.geometry = keepout.geometry = local.geometry = {12, 1, 0.1, 0.0, 0.0};
  for (const auto& row : table) {
    global.value.push_back(row.global == S::kUnknown ? -1 : row.global == S::kOccupied ? 100 : 0);
    keepout.value.push_back(row.global == S::kKeepout ? 100 : 0);
    local.value.push_back(row.local == S::kUnknown ? -1 : row.local == S::kOccupied ? 100 : 0);
  }
  CombinedMap map(0.5, 65, 25);
  map.set_global({}, global, keepout);
  map.set_local(local, Pose2{});
  for (int i = 0; i < 12; ++i) EXPECT_EQ(map.combined().at(i, 0), table[i].combined) << "row " << i;
  // Taken away again, the global map is back.
  map.clear_local();
  for (int i = 0; i < 12; ++i) EXPECT_EQ(map.combined().at(i, 0), table[i].global) << "row " << i;
}

TEST(Overlay, MidValuesAreUnknownAndOutsideIsUnknown) {
  OccupancyGrid grid = room(1.0, 1.0);
  grid.value[grid.geometry.index(5, 5)] = 40;
  CombinedMap map(0.5, 65, 25);
  map.set_global({}, grid, {});
  EXPECT_EQ(map.combined().at(5, 5), CellState::kUnknown);
  EXPECT_EQ(map.combined().at(-1, 5), CellState::kUnknown);
  EXPECT_EQ(map.combined().clearance_m(-3.0, 0.0), 0.0);
}

TEST(Overlay, ALocalWallTurnedBy30DegreesHasNoHoles) {
  CombinedMap map(0.5, 65, 25);
  map.set_global({}, room(6.0, 6.0), {});
  OccupancyGrid local;
  local.geometry = {60, 3, 0.05, -1.5, -0.075};
  local.value.assign(180, 0);
  for (int x = 0; x < 60; ++x) local.value[local.geometry.index(x, 1)] = 100;
  const Pose2 T_map_local{3.0, 3.0, kPi / 6.0};
  map.set_local(local, T_map_local);
  // Nothing gets from one side to the other through 4-neighbours: each point of the wall lies in an occupied cell or in one
  // right beside it, 0.05 m from its middle.
  for (double s = -1.45; s < 1.45; s += 0.01) {
    const Point2 p = T_map_local * Point2{s, 0.0};
    EXPECT_LE(map.combined().clearance_m(p.x_m, p.y_m), 0.05 + 1e-9) << s;
  }
}

/// A corridor of 30 m, with a local map of 10 m whose cell at (12, 1) is occupied while `closed`.
struct Corridor {
  explicit Corridor(double memory_s) : map(0.5, 65, 25, memory_s) { map.set_global({}, room(30.0, 2.0), {}); }
  void look_from(double x_m, bool closed, double now_s) {
    OccupancyGrid local;
    local.geometry = {200, 40, 0.05, -5.0, -1.0};
    local.value.assign(local.geometry.cell_count(), 0);
    const int ix = local.geometry.cell_x(12.0 - x_m), iy = local.geometry.cell_y(0.0);
    if (closed && local.geometry.contains(ix, iy)) local.value[local.geometry.index(ix, iy)] = 100;
    map.set_local(local, {x_m, 1.0, 0.0}, now_s);
  }
  bool closed() const { return map.combined().clearance_m(12.0, 1.0) < 0.1; }
  CombinedMap map;
};

TEST(Overlay, ALaneKeepsItsWidthHoweverTheLocalMapLies) {
  // Marked twice, each box was up to a cell thicker, by the shift of the local map's cells: a lane of 0.55 m was open in one frame's
  // map and closed in the next.
  const OccupancyGrid global = room(4.0, 4.0);
  OccupancyGrid local = room(3.0, 3.0);
  local.value.assign(local.value.size(), 0);
  fill(&local, 1.0, 0.5, 2.0, 1.2, 100);
  fill(&local, 1.0, 1.75, 2.0, 2.5, 100);
  const auto boxes = std::count(local.value.begin(), local.value.end(), static_cast<std::int8_t>(100));
  const auto walls = std::count(global.value.begin(), global.value.end(), static_cast<std::int8_t>(100));
  for (int k = 0; k < 20; ++k) {
    CombinedMap map(0.5, 65, 25);
    map.set_global({}, global, {});
    const Pose2 T_map_local{0.3 + 0.0073 * k, 0.3 + 0.0041 * k, 0.002 * k};
    map.set_local(local, T_map_local);
    const auto& state = map.combined().state;
    EXPECT_LE(std::count(state.begin(), state.end(), CellState::kOccupied), walls + boxes) << k;
    const Point2 middle = T_map_local * Point2{1.5, 1.475};
    int free = 0;
    for (int iy = map.combined().geometry.cell_y(middle.y_m - 0.5); iy < map.combined().geometry.cell_y(middle.y_m + 0.5); ++iy) {
      free += map.combined().at(map.combined().geometry.cell_x(middle.x_m), iy) == CellState::kFree ? 1 : 0;
    }
    EXPECT_NEAR(free, 11, 1) << k;
  }
}

TEST(Overlay, WhatWasClosedStaysSoOffTheLocalMapsEdge) {
  Corridor corridor(60.0);
  corridor.look_from(8.0, true, 100.0);
  EXPECT_TRUE(corridor.closed());
  corridor.look_from(6.0, false, 101.0);  // 12 m is 6 m away now: off the edge
  EXPECT_TRUE(corridor.closed());
  corridor.look_from(4.0, false, 150.0);
  EXPECT_TRUE(corridor.closed());
  corridor.look_from(4.0, false, 162.0);
  EXPECT_FALSE(corridor.closed()) << "it has been off the edge for 60 s";
}

TEST(Overlay, WhatIsOnTheLocalMapAgainIsTheLocalMapsToSay) {
  Corridor corridor(60.0);
  corridor.look_from(8.0, true, 100.0);
  corridor.look_from(6.0, false, 101.0);
  corridor.look_from(8.0, false, 102.0);
  EXPECT_FALSE(corridor.closed());
  corridor.look_from(6.0, false, 103.0);
  EXPECT_FALSE(corridor.closed());
}

TEST(Overlay, WhatIsRememberedRoundAPointCanBeForgotten) {
  Corridor corridor(60.0);
  corridor.look_from(9.0, true, 100.0);
  corridor.look_from(5.0, false, 101.0);
  ASSERT_TRUE(corridor.closed());
  corridor.map.forget_round({14.0, 1.0}, 1.0);
  EXPECT_TRUE(corridor.closed());
  corridor.map.forget_round({12.5, 1.0}, 1.0);
  EXPECT_FALSE(corridor.closed());
}

TEST(Overlay, ClearingForgetsWhatWasRememberedAndWithoutMemoryNothingIs) {
  Corridor corridor(60.0), forgetful(0.0);
  for (Corridor* c : {&corridor, &forgetful}) {
    c->look_from(8.0, true, 100.0);
    c->look_from(6.0, false, 101.0);
  }
  EXPECT_FALSE(forgetful.closed());
  EXPECT_TRUE(corridor.closed());
  corridor.map.clear_local();
  EXPECT_FALSE(corridor.closed());
}

/// From the middle of each cell to the nearest surface of a cell that is not free, over all of them [units^2].
std::vector<double> slow_clearance(const MapLayer& layer) {
  const GridGeometry& g = layer.geometry;
  const int u = layer.units_per_cell, r = layer.reach_cells + 1;
  std::vector<double> squared(g.cell_count());
  for (int iy = 0; iy < g.height_cells; ++iy) {
    for (int ix = 0; ix < g.width_cells; ++ix) {
      double nearest = layer.squared_cut();
      for (int y = iy - r; y <= iy + r; ++y) {
        for (int x = ix - r; x <= ix + r; ++x) {
          if (layer.at(x, y) == CellState::kFree) continue;
          const SurfaceOffset o = g.contains(x, y) ? layer.surface[g.index(x, y)] : SurfaceOffset{};
          const double dx = (x - ix) * u + o.x, dy = (y - iy) * u + o.y;
          nearest = std::min(nearest, dx * dx + dy * dy);
        }
      }
      squared[g.index(ix, iy)] = layer.at(ix, iy) == CellState::kFree ? nearest : 0.0;
    }
  }
  return squared;
}

TEST(Overlay, IncrementalClearanceEqualsThatOfAFreshMap) {
  RandomStream random(3, random_stream::kTest, 0, 0);
  OccupancyGrid global = room(9.0, 7.0);
  for (auto& v : global.value) {
    if (random.uniform() < 0.01) v = 100;
  }
  CombinedMap map(0.7, 65, 25, 3.0);
  map.set_global({}, global, {});
  for (int round = 0; round < 12; ++round) {
    OccupancyGrid local;
    local.geometry = {60, 60, 0.05, -1.5, -1.5};
    for (int i = 0; i < 3600; ++i) {
      const double u = random.uniform();
      local.value.push_back(static_cast<std::int8_t>(u < 0.5 ? -1 : u < 0.97 ? 25.9 * random.uniform() : 100));
    }
    map.set_local(local, {random.uniform(-1.0, 10.0), random.uniform(-1.0, 8.0), random.uniform(-3.0, 3.0)}, round);
    const MapLayer& layer = map.combined();
    TruncatedDistance fresh(layer.reach_cells, layer.units_per_cell);
    std::vector<std::int16_t> all(layer.state.size());
    const GridGeometry& g = layer.geometry;
    fresh.update(g.width_cells, g.height_cells, reinterpret_cast<const std::uint8_t*>(layer.state.data()),
                 static_cast<std::uint8_t>(CellState::kFree), layer.surface.data(), {0, 0, g.width_cells, g.height_cells}, all.data());
    ASSERT_EQ(layer.squared, all) << round;
  }
}

TEST(Overlay, ClearanceIsNeverTooSmallAndAmongLoneSurfacesTooLargeByACellAtMost) {
  RandomStream random(5, random_stream::kTest, 0, 0);
  OccupancyGrid global = room(5.0, 4.0);
  DistanceMap distance;
  distance.geometry = global.geometry;
  for (auto& v : global.value) {
    if (random.uniform() < 0.01) v = 100;
    distance.distance_m.push_back(v == 100 ? static_cast<float>(random.uniform(-0.04, 0.0)) : static_cast<float>(random.uniform(0.01, 0.1)));
  }
  CombinedMap map(0.65, 65, 25);
  map.set_global(distance, global, {});
  const MapLayer& layer = map.combined();
  EXPECT_EQ(layer.units_per_cell, 8);
  int shifted = 0;
  for (const SurfaceOffset& o : layer.surface) shifted += o != SurfaceOffset{} ? 1 : 0;
  EXPECT_GT(shifted, 50) << "the distances place the surfaces";
  const std::vector<double> slow = slow_clearance(layer);
  double sum = 0.0;
  for (std::size_t i = 0; i < slow.size(); ++i) {
    const double exact = std::sqrt(slow[i]), fast = std::sqrt(static_cast<double>(layer.squared[i]));
    ASSERT_GE(fast, exact - 1e-6) << i;
    ASSERT_LE(fast, exact + 1.0 * layer.units_per_cell) << i;
    sum += fast - exact;
  }
  EXPECT_LT(sum / static_cast<double>(slow.size()), 0.01 * layer.units_per_cell);
}

TEST(Overlay, SurfacesInTheMiddleGiveTheExactTransform) {
  RandomStream random(4, random_stream::kTest, 0, 0);
  GridGeometry g{90, 70, 0.05, 0.0, 0.0};
  std::vector<std::uint8_t> blocked(g.cell_count());
  for (int y = 0; y < g.height_cells; ++y) {
    for (int x = 0; x < g.width_cells; ++x) {
      const bool rim = x == 0 || y == 0 || x + 1 == g.width_cells || y + 1 == g.height_cells;
      blocked[g.index(x, y)] = rim || random.uniform() < 0.01 ? 1 : 0;
    }
  }
  const auto exact_m = euclidean_distance_m(g, blocked);
  const std::vector<SurfaceOffset> middles(g.cell_count());
  for (const int units : {1, 8}) {
    for (const SurfaceOffset* surface : {static_cast<const SurfaceOffset*>(nullptr), middles.data()}) {
      TruncatedDistance distance(14, units);
      std::vector<std::int16_t> squared(g.cell_count());
      distance.update(g.width_cells, g.height_cells, blocked.data(), 0, surface, {0, 0, g.width_cells, g.height_cells}, squared.data());
      for (std::size_t i = 0; i < squared.size(); ++i) {
        const double cells = static_cast<double>(exact_m[i]) / 0.05;
        ASSERT_EQ(squared[i], std::min(std::lround(cells * cells) * units * units, static_cast<long>(distance.cut()))) << i;
      }
    }
  }
}

/// What the local mapper shows of two walls across the y axis with a lane between them, in a frame of its own.
OccupancyGrid lane_seen(double low_m, double high_m, const Pose2& T_map_local) {
  OccupancyGrid local;
  local.geometry = {60, 60, 0.05, -1.5, -1.5};
  const GridGeometry& g = local.geometry;
  // Positive in the lane.
  const auto distance = [&](double x, double y) {
    const Point2 p = T_map_local * Point2{x, y};
    return std::min(p.y_m - low_m, high_m - p.y_m);
  };
  for (int iy = 0; iy < g.height_cells; ++iy) {
    for (int ix = 0; ix < g.width_cells; ++ix) {
      const double here = distance(g.center_x_m(ix), g.center_y_m(iy));
      bool surface = false;
      std::int8_t code = 0;
      double steepest = 0.0;
      for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
        const double there = distance(g.center_x_m(ix + dx), g.center_y_m(iy + dy)), cut = here / (here - there);
        if (here <= 0.0 && there > 0.0 && -here < there) surface = true;
        if (here > 0.0 && there <= 0.0 && here <= -there) surface = true;
        if (here - there <= steepest || cut < 0.5 || cut > 1.5) continue;
        steepest = here - there;
        code = SurfaceCode::of(dy == 0, cut);
      }
      local.value.push_back(surface ? 100 : here > 0.0 ? code : -1);
    }
  }
  return local;
}

TEST(Overlay, ALanesWidthDoesNotDependOnHowTheMapsLie) {
  // A robot of 0.5 m in 0.54 m: by the cells' middles each wall was anywhere within 25 mm. The code loses 2 mm, the units 3.
  for (int k = 0; k < 40; ++k) {
    CombinedMap map(0.65, 65, 25);
    map.set_global({}, room(4.0, 4.0), {});
    const Pose2 T_map_local{2.0 + 0.0073 * k, 2.0 + 0.0041 * k, 0.03 * k};
    const double low_m = 1.72 + 0.0029 * k;
    map.set_local(lane_seen(low_m, low_m + 0.54, T_map_local), T_map_local);
    const MapLayer& layer = map.combined();
    // From the cells across the lane, to either wall.
    for (double x_m = 1.8; x_m < 2.3; x_m += 0.05) {
      double widest_m = 0.0, at_m = 0.0;
      for (double y_m = low_m; y_m < low_m + 0.54; y_m += 0.05) {
        const double c = layer.clearance_m(x_m, y_m);
        if (c <= widest_m) continue;
        widest_m = c;
        at_m = layer.geometry.center_y_m(layer.geometry.cell_y(y_m));
      }
      EXPECT_NEAR(widest_m, std::min(at_m - low_m, low_m + 0.54 - at_m), 0.009) << k << " at " << x_m;
    }
    for (double y_m = low_m + 0.15; y_m < low_m + 0.4; y_m += 0.01) {
      const double exact_m = std::min(y_m - low_m, low_m + 0.54 - y_m);
      // The middle's ridge is cut off by half a cell at most.
      EXPECT_NEAR(layer.smooth_clearance_m(2.05, y_m), exact_m, exact_m > 0.24 ? 0.028 : 0.012) << k << " at " << y_m - low_m;
    }
  }
}

TEST(Overlay, MapsThatDoNotFitTogetherAreRefusedInWords) {
  CombinedMap map(0.5, 65, 25);
  EXPECT_THROW(map.set_global({}, {}, {}), UserError);
  OccupancyGrid keepout = room(2.0, 1.0);
  try {
    map.set_global({}, room(1.0, 1.0), keepout);
    FAIL();
  } catch (const UserError& error) {
    EXPECT_NE(std::string(error.what()).find("keepout"), std::string::npos);
  }
  EXPECT_TRUE(map.empty());
}

TEST(Overlay, ADistanceMapAloneMakesAMap) {
  DistanceMap distance;
  distance.geometry = {4, 1, 0.1, 0.0, 0.0};
  distance.distance_m = {std::nanf(""), 0.2f, 0.02f, -0.1f};
  CombinedMap map(0.5, 65, 25);
  map.set_global(distance, {}, {});
  EXPECT_EQ(map.global().at(0, 0), CellState::kUnknown);
  EXPECT_EQ(map.global().at(1, 0), CellState::kFree);
  EXPECT_EQ(map.global().at(2, 0), CellState::kOccupied);
  EXPECT_EQ(map.global().at(3, 0), CellState::kOccupied);
}

}  // namespace
}  // namespace knav
