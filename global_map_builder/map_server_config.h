#pragma once

#include <string>
#include <vector>

namespace knav {

struct MapServerConfig {
  std::string map_path;
  std::string frame_id = "map";

  template <class Visitor>
  void visit(Visitor& v) {
    v.text("map_path", map_path,
           "Map directory written by build_map, or a map_server YAML file; empty: none yet.");
    v.text("frame_id", frame_id, "Frame of the maps.");
  }
  std::vector<std::string> validate() const {
    if (frame_id.empty()) return {"frame_id must not be empty."};
    return {};
  }
};

}  // namespace knav
