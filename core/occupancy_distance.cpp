#include "core/occupancy_distance.h"

#include <cstdint>
#include <limits>

#include "core/distance_transform.h"
#include "core/error.h"

namespace knav {

DistanceMap distance_from_occupancy(const OccupancyGrid& occupancy) {
  constexpr int kOccupiedFrom = 65, kFreeTo = 25;
  const GridGeometry& geometry = occupancy.geometry;
  if (occupancy.value.size() != geometry.cell_count()) {
    throw UserError("map: the number of its values is not width x height; build or load another one.");
  }
  std::vector<std::uint8_t> wall(geometry.cell_count()), open(geometry.cell_count());
  for (std::size_t i = 0; i < wall.size(); ++i) {
    wall[i] = occupancy.value[i] >= kOccupiedFrom;
    open[i] = !wall[i];
  }
  const std::vector<float> to_wall = euclidean_distance_m(geometry, wall);
  const std::vector<float> to_open = euclidean_distance_m(geometry, open);
  const auto half_cell = static_cast<float>(geometry.resolution_m / 2.0);
  DistanceMap map;
  map.geometry = geometry;
  map.distance_m.resize(geometry.cell_count());
  for (std::size_t i = 0; i < wall.size(); ++i) {
    const int value = occupancy.value[i];
    map.distance_m[i] = wall[i]                          ? half_cell - to_open[i]
                        : value >= 0 && value <= kFreeTo ? to_wall[i] - half_cell
                                                         : std::numeric_limits<float>::quiet_NaN();
  }
  return map;
}

}  // namespace knav
