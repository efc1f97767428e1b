#pragma once

#include <cstddef>
#include <vector>

#include "core/pose2.h"
#include "planner_tracker/combined_map.h"

namespace knav {

/// Which of the cells that the local map shows occupied have only just become so, where nothing stood: somebody walks there, or
/// something was put down. As far as the robot's own data tell: a contour that shifts by a cell or two as the local map is
/// aligned is no motion; but furniture that the global map does not have counts for a second when it first comes into view.
class MovingCells {
 public:
  static constexpr double kFresh_s = 1.0;  ///< a cell counts for so long
  static constexpr int kShift_cells = 3;   ///< what lies so near to something that stood there before is that
  static constexpr double kTrail_s = 15.0, kTrailWithin_m = 4.5;  ///< at 10 m a Kinect errs by half a metre
  static constexpr std::size_t kFewest = 4;  ///< cells; fewer are noise

  void reset(const MapLayer& layer);
  /// Call after every new local map. @param window  of the cells that it covers @param robot  in the map
  void update(const MapLayer& global, const MapLayer& combined, const CellWindow& window, const Point2& robot, double now_s);

  /// In the map.
  const std::vector<Point2>& points() const { return points_; }
  /// Where somebody was on his way: occupied for a moment within the last kTrail_s and not far from the robot, free again now, and nothing
  /// stands beside it. A thing that comes into view leaves no trail, though its surface is at first seen some decimetres off.
  const std::vector<Point2>& trail() const { return trail_; }

 private:
  bool is_trail(const MapLayer& global, const MapLayer& combined, int ix, int iy, float now) const;
  bool stood_near(const MapLayer& global, int ix, int iy, double now_s) const;

  GridGeometry geometry_;
  // Per cell, seconds; 0 = never.
  std::vector<float> occupied_from_s_, occupied_to_s_;
  std::vector<float> occupied_near_s_;  ///< last, while the robot was within kTrailWithin_m
  double begin_s_ = -1.0;  ///< stamps count from here: a float holds the milliseconds of a day, not of an epoch
  std::vector<Point2> points_, trail_;
};

}  // namespace knav
