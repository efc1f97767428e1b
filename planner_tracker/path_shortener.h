#pragma once

#include <vector>

#include "core/pose2.h"
#include "planner_tracker/search_graph.h"

namespace knav {

/// Pulls a way over cells straight, where the straight line is open and no dearer.
class PathShortener {
 public:
  /// Cost [m] of a straight line, sampled a cell apart; +Inf if a sample is closed.
  double segment_cost_m(const MapLayer& layer, const ClearancePrice& price, const Point2& from,
                        const Point2& to) const;
  /// @param points a way whose consecutive points can be driven straight; corners remain
  void shorten(const MapLayer& layer, const ClearancePrice& price, std::vector<Point2>* points);

 private:
  void pull(const MapLayer& layer, const ClearancePrice& price, std::vector<Point2>* points);
  void split(double longest_m, std::vector<Point2>* points);

  std::vector<double> cost_m_;  ///< scratch: from the first point on
  std::vector<Point2> kept_;
};

}  // namespace knav
