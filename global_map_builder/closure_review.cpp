#include "global_map_builder/closure_review.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace knav {

bool refuse_contradicted(const ClosureConfig& config, const std::vector<Pose2>& T_map_keyframe, PoseGraph* graph,
                         std::vector<Closure>* closures) {
  bool any = false;
  for (Closure& closure : *closures) {
    if (!closure.accepted || closure.verdict == "allow") continue;
    const Pose2 fitted = T_map_keyframe[static_cast<std::size_t>(closure.from)].inverse() *
                         T_map_keyframe[static_cast<std::size_t>(closure.to)];
    const double off_m = distance_m(closure.match.T_from_to, fitted);
    const double off_deg = std::fabs(normalize_angle_rad(closure.match.T_from_to.yaw_rad - fitted.yaw_rad)) * 180.0 / kPi;
    if (off_m <= config.fitted_max_m && off_deg <= config.fitted_max_deg) continue;
    closure.accepted = false;
    closure.reason = fmt::format("with all views fitted the two visits lie {:.2f} m and {:.1f} deg from where it has them", off_m, off_deg);
    auto& edges = graph->edges;
    edges.erase(std::remove_if(edges.begin(), edges.end(),
                               [&](const PoseGraphEdge& e) { return e.robust && e.from == closure.from && e.to == closure.to; }),
                edges.end());
    any = true;
  }
  return any;
}

}  // namespace knav
