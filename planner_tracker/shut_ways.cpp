#include "planner_tracker/shut_ways.h"

#include <algorithm>
#include <cmath>

namespace knav {
namespace {
constexpr double kRound_m = 1.5;  ///< what closes a corridor leaves gaps on either side of it: they belong together
constexpr double kSame_m = 1.0;
constexpr double kAnotherTime_s = 5.0;
constexpr int kOften = 2;
}  // namespace

void ShutWays::add(const Point2& at, double now_s, double until_s) {
  for (Shut& s : shut_) {
    if (now_s > s.until_s || std::hypot(s.at.x_m - at.x_m, s.at.y_m - at.y_m) > kSame_m) continue;
    if (now_s - s.last_s > kAnotherTime_s) ++s.times;
    s.last_s = now_s;
    s.until_s = until_s;
    return;
  }
  shut_.push_back({at, until_s, now_s, 1});
}

bool ShutWays::has(const Point2& at, double round_m, double now_s) const {
  return std::any_of(shut_.begin(), shut_.end(), [&](const Shut& s) {
    return now_s <= s.until_s && std::hypot(s.at.x_m - at.x_m, s.at.y_m - at.y_m) < round_m;
  });
}

bool ShutWays::barely_open(const CombinedMap& map, const std::vector<Point2>& path, double clear_m, double now_s) {
  shut_.erase(std::remove_if(shut_.begin(), shut_.end(), [&](const Shut& s) { return now_s > s.until_s; }), shut_.end());
  if (shut_.empty()) return false;
  const MapLayer& layer = map.combined();
  for (std::size_t i = 1; i < path.size(); ++i) {
    const Point2 a = path[i - 1], b = path[i];
    const int steps = 1 + static_cast<int>(std::hypot(b.x_m - a.x_m, b.y_m - a.y_m) / layer.geometry.resolution_m);
    for (int k = 0; k <= steps; ++k) {
      const double share = static_cast<double>(k) / steps;
      const Point2 p{a.x_m + share * (b.x_m - a.x_m), a.y_m + share * (b.y_m - a.y_m)};
      const bool narrow = layer.clearance_m(p.x_m, p.y_m) < clear_m;
      const auto shut_there = [&](const Shut& s) {
        return (narrow || s.times >= kOften || !map.seen(s.at)) && std::hypot(s.at.x_m - p.x_m, s.at.y_m - p.y_m) < kRound_m;
      };
      if (std::any_of(shut_.begin(), shut_.end(), shut_there)) return true;
    }
  }
  return false;
}

}  // namespace knav
