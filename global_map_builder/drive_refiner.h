#pragma once

#include <functional>
#include <vector>

#include "global_map_builder/drive.h"
#include "global_map_builder/map_builder_config.h"
#include "global_map_builder/submap_matcher.h"

namespace knav {

/// Extra edges between keyframes a few metres apart along the drive, by laying what was seen round one on
/// what was seen round the other. The particle filter's estimate wavers by its sampling noise; these edges
/// take that out, and being longer than a step they keep it from adding up.
std::vector<PoseGraphEdge> refine_drive(const RefinementConfig& config, const SurfaceConfig& surface,
                                        const Drive& drive, const std::function<void(double)>& progress);

}  // namespace knav
