#pragma once

#include <string>
#include <vector>

#include "localizer_benchmark/measures.h"
#include "localizer_benchmark/unique_places.h"

namespace knav {

/// Starts without a hint, cut from drives: those whose view matches one place only, and others that match several.
struct Starts {
  std::vector<Stretch> unique, ambiguous;
};

/// Tries moments of the drives in turn, evenly spread, until `wanted` of them are unique or none is left.
/// @param world_map truth, in the world's frame
Starts find_starts(const std::vector<ProfileRecording>& drives, const DistanceMap& world_map, std::size_t wanted);

/// `wanted` kidnaps: from wherever the robot is at the end of a stretch to a few seconds before a look round.
std::vector<Stretch> lay_out_kidnaps(const std::vector<ProfileRecording>& drives, std::size_t wanted, int seed);

}  // namespace knav
