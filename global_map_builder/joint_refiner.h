#pragma once

#include <functional>
#include <vector>

#include "global_map_builder/drive.h"
#include "global_map_builder/map_builder_config.h"
#include "global_map_builder/pose_graph.h"
#include "global_map_builder/range_offset.h"

namespace knav {

/// What joint refinement made of a graph.
struct JointRefinement {
  std::vector<Pose2> T_map_keyframe;
  std::vector<RangeOffset> offset;  ///< one a drive: what its depth camera is steadily wrong by
  std::size_t pairs = 0;            ///< of keyframes that see the same surfaces
  int iterations = 0;
  double misfit_before = 0.0, misfit_after = 0.0;  ///< mean robust cost of a common surface point
  bool kept = false;                               ///< false: it did not fit better, so poses are the graph's
};

/// Bends the drives until what their keyframes see fits together: every keyframe's frame is compared with up to
/// `max_partners` others that see the same surfaces, point to line, near readings outweighing far ones, and all
/// poses and the depth cameras' steady errors are solved for at once (Gauss-Newton), together with the graph's
/// edges. What local maps of a few metres cannot tell, how a long way round a hall is bent, follows from walls seen
/// from far apart; and what looks like a bend but is the sensor's error shows as such, since it goes with the
/// column and not with the place.
/// The graph's held nodes stay.
/// @param robust_scale  closures farther off than so many standard deviations fade
JointRefinement refine_jointly(const JointRefinementConfig& config, const std::vector<Drive>& drives,
                               const PoseGraph& graph, double robust_scale,
                               const std::function<void(double)>& progress);

}  // namespace knav
