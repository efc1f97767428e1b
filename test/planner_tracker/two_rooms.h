#pragma once

#include "toy_world.h"

namespace knav {

/// Two rooms of 6 x 6 m side by side, joined by a door of 0.9 m below and one above.
inline OccupancyGrid two_rooms() {
  OccupancyGrid grid = room(12.0, 6.0);
  fill(&grid, 5.95, 0.0, 6.05, 6.0, 100);
  fill(&grid, 5.95, 1.0, 6.05, 1.9, 0);
  fill(&grid, 5.95, 4.3, 6.05, 5.2, 0);
  return grid;
}

}  // namespace knav
