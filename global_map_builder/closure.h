#pragma once

#include <string>
#include <vector>

#include "global_map_builder/submap_matcher.h"

namespace knav {

/// Two visits of one place, and what was made of them.
struct Closure {
  int from = 0, to = 0;   ///< nodes of the graph, from < to
  std::string source;     ///< "button", "automatic", "located" (a drive found in another) or "list"
  std::string verdict;    ///< of the user's list: "allow", "deny" or empty
  bool matched = false;   ///< by the local maps; otherwise the button's or the list's word alone
  bool accepted = false;  ///< used by the map
  std::string reason;     ///< why not
  MatchResult match;
  double chi2 = 0.0;  ///< of its edge in the final graph
  /// What was laid on what, each in its own keyframe's frame, thinned: for pictures.
  std::vector<SurfacePoint> from_points, to_points;
};

/// The user's word on a pair of visits.
struct ClosureVerdict {
  int from = 0, to = 0;
  bool allow = false;  ///< true: forced in with T_from_to; false: kept out
  Pose2 T_from_to;
  bool has_transform = false;
};

}  // namespace knav
