#pragma once

#include <string>
#include <vector>

namespace knav {

/// What the localizer and the planner are given. Both keys together make the difference between the paper's
/// two benchmark runs (section IV.B, table 1).
struct NavigationInputConfig {
  bool local_map = true;
  std::string localize_with = "scan_360";

  template <class Visitor>
  void visit(Visitor& v) {
    v.flag("local_map", local_map,
           "The planner lays the local map over the global one. false: it sees the 57-degree scan only.");
    v.choice(
        "localize_with", localize_with, {"scan_360", "scan"},
        "scan_360: the local mapper's scan and motion. scan: the 57-degree scan of one frame, and odometry.");
  }
  std::vector<std::string> validate() const { return {}; }
};

}  // namespace knav
