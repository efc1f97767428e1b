#pragma once

#include <string>
#include <vector>

namespace knav {

/// Parameters of the nodelet kinect_nav/TourDriver.
struct TourDriverConfig {
  std::string script;
  std::string start_after;
  double start_delay_s = 1.0;

  template <class Visitor>
  void visit(Visitor& v) {
    v.text("script", script, "Path of the tour script.");
    v.text("start_after", start_after, "A topic whose first message lets the tour begin; empty: at once.");
    v.number("start_delay_s", start_delay_s, 0, 600, "s", "Simulated time to wait before the tour.");
  }
  std::vector<std::string> validate() const { return {}; }
};

}  // namespace knav
