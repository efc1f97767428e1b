#pragma once

#include <vector>

#include "core/pose2.h"
#include "planner_tracker/combined_map.h"

namespace knav {

/// Ways that the robot found closed, and went round. A gap just as wide as the robot is open in one frame's map and
/// closed in the next, or looks open from afar and closed from near; who turns back for it each time gets nowhere.
class ShutWays {
 public:
  void clear() { shut_.clear(); }
  /// Found closed, and remembered until then. Again after some seconds counts as another time.
  void add(const Point2& at, double now_s, double until_s);
  /// True if a place within `round_m` of this one was found closed.
  bool has(const Point2& at, double round_m, double now_s) const;
  /// True if the path leads past a place that was found closed, and is no wider there than `clear_m` on either side; or however
  /// wide it looks if it was found closed more than once, or is off the local map: then it has been forgotten, not seen open.
  bool barely_open(const CombinedMap& map, const std::vector<Point2>& path, double clear_m, double now_s);

 private:
  struct Shut {
    Point2 at;
    double until_s, last_s;
    int times;
  };
  std::vector<Shut> shut_;
};

}  // namespace knav
