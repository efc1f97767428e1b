// What becomes of cells that nobody saw, or that lie behind what was taken for noise: hand-drawn grids.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "global_map_builder/map_occupancy.h"

namespace knav {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

/// '.' seen free, '?' not seen, '-' behind a surface; the first line is the highest row.
struct Drawn {
  explicit Drawn(const std::vector<std::string>& rows) {
    geometry = {static_cast<int>(rows[0].size()), static_cast<int>(rows.size()), 0.05, 0.0, 0.0};
    for (auto row = rows.rbegin(); row != rows.rend(); ++row) {
      for (const char c : *row) value_m.push_back(c == '.' ? 0.2f : c == '-' ? -0.02f : kNaN);
    }
  }
  GridGeometry geometry;
  std::vector<float> value_m;
};

const Drawn kHoles({
    "..........",
    ".?...??...",
    "..........",
    "...-..?...",
    ".....?.??.",
    "......?...",
    "?.........",
});

TEST(LoneHoles, ASingleCellAmidFreeOnesIsOneLargerPiecesAndTheRimAreNot) {
  std::vector<bool> open;
  for (const float value : kHoles.value_m) open.push_back(value > 0.0f);
  const std::vector<bool> hole = lone_holes(kHoles.geometry, open, 0.25);
  const auto at = [&](int ix, int iy) { return hole[kHoles.geometry.index(ix, iy)]; };
  EXPECT_TRUE(at(1, 5));   // unseen
  EXPECT_TRUE(at(3, 3));   // behind lone noise
  EXPECT_FALSE(at(5, 5));  // two cells: a rim of six sides, 0.3 m
  EXPECT_FALSE(at(6, 5));
  EXPECT_FALSE(at(7, 2));
  EXPECT_FALSE(at(0, 0));  // open to what lies outside the map
  EXPECT_TRUE(at(6, 3));   // three single cells, though they touch at their corners
  EXPECT_TRUE(at(5, 2));
  EXPECT_TRUE(at(6, 1));
  const std::vector<bool> wider = lone_holes(kHoles.geometry, open, 0.3);
  EXPECT_TRUE(wider[kHoles.geometry.index(5, 5)]);
  for (const bool any : lone_holes(kHoles.geometry, open, 0.0)) EXPECT_FALSE(any);
}

TEST(OccupancyFromSurface, HolesAndDrivenCellsAreFreeTheRestKeepsItsSign) {
  std::vector<float> distance_m(kHoles.value_m.size(), 0.3f);
  std::vector<bool> driven(kHoles.value_m.size(), false);
  driven[kHoles.geometry.index(5, 5)] = true;
  const Contour contour{{{0.401, 0.301}, {0.449, 0.349}}};  // in cell (8, 6)
  const OccupancyGrid grid =
      occupancy_from_surface(kHoles.geometry, kHoles.value_m, driven, contour, 0.25, &distance_m);
  const auto index = [](int ix, int iy) { return kHoles.geometry.index(ix, iy); };
  EXPECT_EQ(grid.value[index(0, 6)], 0);
  EXPECT_EQ(grid.value[index(1, 5)], 0);
  EXPECT_FLOAT_EQ(distance_m[index(1, 5)], 0.3f);
  EXPECT_EQ(grid.value[index(3, 3)], 0);
  EXPECT_FLOAT_EQ(distance_m[index(3, 3)], 0.3f);
  EXPECT_EQ(grid.value[index(5, 5)], 0);
  EXPECT_EQ(grid.value[index(6, 5)], 0);  // what the robot's body leaves of the pair is a lone hole
  EXPECT_EQ(grid.value[index(7, 2)], -1);
  EXPECT_TRUE(std::isnan(distance_m[index(7, 2)]));
  EXPECT_EQ(grid.value[index(8, 6)], 100);
}

TEST(OccupancyFromSurface, DrivenGroundIsFreeUnlessASurfaceWasSeenThere) {
  // A row of cells of 0.05 m: free, unseen, the shadow of an edge (the nearest surface is farther off than the ray said),
  // inside a wall, the wall itself.
  const GridGeometry row{5, 1, 0.05, 0.0, 0.0};
  const std::vector<float> value_m{0.1f, kNaN, -0.05f, -0.05f, 0.0f};
  const Contour contour{{{0.201, 0.001}, {0.249, 0.049}}};
  for (const bool was_there : {false, true}) {
    std::vector<float> distance_m{0.2f, 0.4f, 0.4f, 0.05f, 0.0f};
    const OccupancyGrid grid =
        occupancy_from_surface(row, value_m, std::vector<bool>(5, was_there), contour, 0.0, &distance_m);
    EXPECT_EQ(grid.value[0], 0);
    EXPECT_EQ(grid.value[1], was_there ? 0 : -1);
    EXPECT_EQ(grid.value[2], was_there ? 0 : -1);
    EXPECT_EQ(grid.value[3], -1);
    EXPECT_EQ(grid.value[4], 100);
    EXPECT_EQ(std::isnan(distance_m[2]), !was_there);
    EXPECT_FLOAT_EQ(distance_m[3], -0.05f);
  }
}

// A planner keeps 4 cm off what is unknown: the way of a robot through ground that its camera never saw has to be wider than its body.
TEST(MarkDriven, AStraightWayIsAsWideAsAsked) {
  const GridGeometry room{60, 40, 0.05, 0.0, 0.0};
  Trajectory straight;
  for (int i = 0; i <= 100; ++i) straight.push_back({0.1 * i, {0.5 + 0.02 * i, 1.0, 0.0}});
  std::vector<bool> driven(room.cell_count(), false);
  mark_driven(room, straight, 0.28, &driven);
  for (int iy = 0; iy < room.height_cells; ++iy) {
    EXPECT_EQ(driven[room.index(30, iy)], std::abs(room.center_y_m(iy) - 1.0) <= 0.28) << iy;
  }
  EXPECT_FALSE(driven[room.index(1, 20)]);
}

}  // namespace
}  // namespace knav
