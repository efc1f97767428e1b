#pragma once

#include <cmath>
#include <vector>

#include "core/pose2.h"

namespace knav {

/// Where the tracker waited in vain although the plan leads on: lanes narrower than the map has them. No map
/// shows what closes such a way, so that planning would lead back to it for ever.
class RefusedWays {
 public:
  void clear() { places_.clear(); }
  void note(const Point2& at, double now_s) {
    for (Place& p : places_) {
      if (std::hypot(p.at.x_m - at.x_m, p.at.y_m - at.y_m) > kSamePlace_m) continue;
      p = {at, now_s, p.times + 1};
      return;
    }
    places_.push_back({at, now_s, 1});
  }
  /// Adds those where it happened more than once within memory_s: once may have been somebody who has walked on.
  void add_to(std::vector<Point2>* points, double now_s, double memory_s) const {
    for (const Place& p : places_) {
      if (p.times > 1 && now_s - p.last_s < memory_s) points->push_back(p.at);
    }
  }

 private:
  static constexpr double kSamePlace_m = 1.0;
  struct Place {
    Point2 at;
    double last_s;
    int times;
  };
  std::vector<Place> places_;
};

}  // namespace knav
