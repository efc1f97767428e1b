#pragma once

#include "core/distance_map.h"
#include "global_map_builder/map_directory.h"
#include "kinect_sim/world.h"

namespace knav {

/// The map that a faultless mapping drive would give: the true signed distance to what stands in the building between the
/// heights that the sensor's slice takes, exact up to a metre, in the world's frame. Known is what can be reached from the
/// start, and a little of what bounds it.
DistanceMap truth_map(const WorldConfig& world);

/// The same as a map directory holds it, in the world's frame. Occupied is a cell whose middle is inside something or within half a
/// cell of its surface.
MapDirectory truth_map_directory(const WorldConfig& world);

}  // namespace knav
