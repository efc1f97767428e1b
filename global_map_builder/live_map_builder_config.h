#pragma once

#include <string>
#include <vector>

namespace knav {

/// The node that builds a map while the robot drives. How it builds and how it maps are the sections
/// map_builder and local_mapper, as for build_map.
struct LiveMapBuilderConfig {
  std::string directory;
  bool build_at_end = true;
  double map_period_s = 3.0;
  double map_resolution_m = 0.1;
  std::string odom_frame = "odom";
  int frames_waiting = 60;

  template <class Visitor>
  void visit(Visitor& v) {
    v.text("directory", directory, "The map directory to write.");
    v.flag("build_at_end", build_at_end, "Build when the node ends, if finish_mapping was not called.");
    v.number("map_period_s", map_period_s, 0.2, 600, "s", "How often growing_map is published.");
    v.number("map_resolution_m", map_resolution_m, 0.02, 1, "m", "Its cells.");
    v.text("odom_frame", odom_frame, "The frame growing_map is given in.");
    v.integer("frames_waiting", frames_waiting, 1, 1000, "", "Frames that may wait for odometry.");
  }
  std::vector<std::string> validate() const {
    if (directory.empty()) return {"'directory' must name the map directory to write."};
    return {};
  }
};

}  // namespace knav
