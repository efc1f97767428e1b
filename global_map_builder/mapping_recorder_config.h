#pragma once

#include <string>
#include <vector>

namespace knav {

struct MappingRecorderConfig {
  std::string bag;
  double depth_s = 20.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.text("bag", bag, "The recording to write; it appears under this name when the node ends.");
    v.number("depth_s", depth_s, 0, 1e6, "s", "Raw depth is recorded for the first seconds; 18 MB each.");
  }
  std::vector<std::string> validate() const {
    if (bag.empty()) return {"'bag' must name the file to write."};
    return {};
  }
};

}  // namespace knav
