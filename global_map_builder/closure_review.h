#pragma once

#include <vector>

#include "core/pose2.h"
#include "global_map_builder/closure.h"
#include "global_map_builder/map_builder_config.h"
#include "global_map_builder/pose_graph.h"

namespace knav {

/// Closures that the fitted drives contradict are no longer accepted, nor part of the graph: what many views say outweighed them.
/// Those of the user's list stay.
/// @return whether there were any
/// @param T_map_keyframe  one per node, all views fitted
bool refuse_contradicted(const ClosureConfig& config, const std::vector<Pose2>& T_map_keyframe, PoseGraph* graph,
                         std::vector<Closure>* closures);

}  // namespace knav
