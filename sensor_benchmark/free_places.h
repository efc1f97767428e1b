#pragma once

#include <cstdint>
#include <vector>

#include "core/pose2.h"
#include "kinect_sim/world.h"

namespace knav {

/// Poses at random in the free space around a building's named places, facing anywhere, `clearance_m` away
/// from everything.
std::vector<Pose2> free_places(const WorldConfig& world, double clearance_m, int count, std::uint64_t seed);

}  // namespace knav
