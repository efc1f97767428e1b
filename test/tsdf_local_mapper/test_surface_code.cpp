// Where in their cells the surfaces of local_map are: a planner measures lanes by it.
#include <gtest/gtest.h>

#include <cmath>

#include "core/contour.h"
#include "core/surface_code.h"
#include "tsdf_local_mapper/local_map.h"

namespace knav {
namespace {

/// A wall n p = d, seen from places along it.
struct Wall {
  double nx, ny, d_m;
  double off_m(const Point2& p) const { return nx * p.x_m + ny * p.y_m - d_m; }
};

OccupancyGrid map_of(const Wall& wall) {
  TsdfGrid grid(TsdfConfig{}, 12.0);
  std::uint32_t sequence = 0;
  for (double along = -0.6; along <= 0.6; along += 0.05) {
    const Pose2 T_map_sensor{-wall.ny * along, wall.nx * along, std::atan2(wall.ny, wall.nx)};
    DepthProfile profile;
    profile.fx_px = 585;
    profile.cx_px = 319.5;
    profile.height_class.assign(640, HeightClass::kMiddle);
    for (int u = 0; u < 640; ++u) {
      profile.z_m.push_back(static_cast<float>(wall.d_m));  // straight before it, every column has the same depth
      profile.free_from_m.push_back(0.5f);
      profile.free_to_m.push_back(static_cast<float>(wall.d_m));
    }
    ObservationLimits limits;
    limits.truncation = TsdfConfig{}.truncation;
    TsdfObservation o;
    observation_from(profile, limits, &o);
    o.sequence = ++sequence;
    o.T_map_sensor = T_map_sensor;
    grid.add(o);
  }
  OccupancyGrid map;
  extract_occupancy(grid, 0.0, 0.0, 10.0, SurfaceRule(ContourConfig{}.surface_within), &map);
  return map;
}

TEST(SurfaceCode, SurfacesAreWhereTheWallIsWhereverItCutsTheCells) {
  for (int k = 0; k < 24; ++k) {
    const double angle = 0.13 * k;
    const Wall wall{std::cos(angle), std::sin(angle), 2.0 + 0.0047 * k};
    const OccupancyGrid map = map_of(wall);
    const GridGeometry& g = map.geometry;
    int cells = 0;
    double sum = 0.0, squares = 0.0;
    for (int iy = 1; iy + 1 < g.height_cells; ++iy) {
      for (int ix = 1; ix + 1 < g.width_cells; ++ix) {
        const Point2 middle{g.center_x_m(ix), g.center_y_m(iy)};
        if (map.value[g.index(ix, iy)] != 100 || std::abs(-wall.ny * middle.x_m + wall.nx * middle.y_m) > 0.7) continue;
        const Point2 in_cell = surface_in_cell(map, ix, iy);
        const double off_m = wall.off_m({middle.x_m + in_cell.x_m * g.resolution_m, middle.y_m + in_cell.y_m * g.resolution_m});
        EXPECT_LT(std::abs(off_m), 0.012) << "wall " << k << " at (" << middle.x_m << ", " << middle.y_m << ")";
        sum += off_m;
        squares += off_m * off_m;
        ++cells;
      }
    }
    ASSERT_GT(cells, 15) << k;
    // A step of the code is 4 mm, of which half is lost. By the cells' middles it would be up to 25 mm, 14 mm in the mean square.
    EXPECT_LT(std::abs(sum / cells), 0.003) << k;
    EXPECT_LT(std::sqrt(squares / cells), 0.004) << k;
  }
}

TEST(SurfaceCode, FreeCellsStayFreeForWhoeverReadsAnOccupancyGrid) {
  const OccupancyGrid map = map_of({1.0, 0.0, 2.02});
  int coded = 0;
  for (const std::int8_t value : map.value) {
    EXPECT_TRUE(value == -1 || value == 100 || (value >= 0 && value <= 25)) << static_cast<int>(value);
    coded += SurfaceCode::is_code(value) ? 1 : 0;
  }
  EXPECT_GT(coded, 15);
}

TEST(SurfaceCode, AMapWithoutItHasItsSurfacesInTheMiddle) {
  OccupancyGrid map;
  map.geometry = {3, 3, 0.05, 0.0, 0.0};
  map.value = {0, 0, 0, 0, 100, 0, 0, 0, 0};
  EXPECT_EQ(surface_in_cell(map, 1, 1).x_m, 0.0);
  EXPECT_EQ(surface_in_cell(map, 1, 1).y_m, 0.0);
  map.value[3] = SurfaceCode::of(true, 0.625);  // the cell on the left: the surface is 0.625 cells from its middle
  EXPECT_NEAR(surface_in_cell(map, 1, 1).x_m, -0.375, 0.5 / SurfaceCode::kSteps);
  EXPECT_EQ(surface_in_cell(map, 1, 1).y_m, 0.0);
  map.value[1] = SurfaceCode::of(false, 0.625);  // and so below: a wall aslant, whose nearest point is half as far along either axis
  EXPECT_NEAR(surface_in_cell(map, 1, 1).x_m, -0.1875, 0.5 / SurfaceCode::kSteps);
  EXPECT_NEAR(surface_in_cell(map, 1, 1).y_m, -0.1875, 0.5 / SurfaceCode::kSteps);
  map.value[1] = 0;
  map.value[5] = SurfaceCode::of(true, 0.625);  // seen from both sides, a leg of 0.75 cells: its middle
  EXPECT_NEAR(surface_in_cell(map, 1, 1).x_m, 0.0, 1e-9);
}

}  // namespace
}  // namespace knav
