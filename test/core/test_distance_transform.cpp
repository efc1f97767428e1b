#include <gtest/gtest.h>

#include <cmath>

#include "core/distance_transform.h"
#include "core/random.h"

namespace knav {
namespace {

TEST(EuclideanDistance, AgreesWithTrueMinimumOnRandomGrids) {
  for (std::uint32_t trial = 0; trial < 20; ++trial) {
    RandomStream random(trial, random_stream::kTest, 0, 0);
    GridGeometry grid;
    grid.width_cells = 1 + static_cast<int>(random.uniform() * 30);
    grid.height_cells = 1 + static_cast<int>(random.uniform() * 30);
    grid.resolution_m = 0.05;
    std::vector<std::uint8_t> occupied(grid.cell_count());
    for (auto& cell : occupied) cell = random.uniform() < 0.03;
    const auto distance = euclidean_distance_m(grid, occupied);
    for (int y = 0; y < grid.height_cells; ++y) {
      for (int x = 0; x < grid.width_cells; ++x) {
        double best = INFINITY;
        for (int v = 0; v < grid.height_cells; ++v) {
          for (int u = 0; u < grid.width_cells; ++u) {
            if (occupied[grid.index(u, v)]) best = std::min(best, std::hypot(u - x, v - y) * 0.05);
          }
        }
        if (std::isinf(best)) {
          EXPECT_TRUE(std::isinf(distance[grid.index(x, y)]));
        } else {
          EXPECT_NEAR(distance[grid.index(x, y)], best, 1e-5);
        }
      }
    }
  }
}

}  // namespace
}  // namespace knav
