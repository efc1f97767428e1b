#pragma once

#include <functional>

#include "global_map_builder/drive.h"
#include "global_map_builder/map_builder_config.h"

namespace knav {

/// Takes the local mapper's rare jumps out of a drive. From one keyframe to the next the mapper is good to
/// millimetres, but now and then its filter settles beside the truth and comes back seconds later. A small
/// graph weighs three witnesses: the mapper's steps, precise, without those that part from odometry far more
/// than usual (bad odometry parts from the mapper everywhere and so accuses no step); odometry, its steady
/// errors measured on this very drive and taken out; and direct alignment of what was seen a few metres
/// apart, coarse but free of drift.
/// @return the number of steps found to be jumps
int smooth_drive(const RefinementConfig& config, const GraphOptimizerConfig& graph,
                 const SurfaceConfig& surface, Drive* drive, const std::function<void(double)>& progress);

}  // namespace knav
