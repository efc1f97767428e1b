#pragma once

#include <cstddef>
#include <vector>

#include "core/pose2.h"

namespace knav {

/// A polyline with a place on it that only moves on as the robot does.
class Path {
 public:
  void set(const std::vector<Point2>& points);
  void clear() { set({}); }
  bool empty() const { return points_.empty(); }
  double length_m() const { return empty() ? 0.0 : along_m_.back(); }
  const std::vector<Point2>& points() const { return points_; }
  Point2 end() const { return points_.back(); }

  /// Moves the place on it to the point nearest to the robot, looked for from a little behind the last one to
  /// a few metres ahead, so that a path that comes back beside itself is not cut short.
  void advance(const Point2& robot);
  double at_m() const { return at_m_; }
  double remaining_m() const { return length_m() - at_m_; }
  double offset_m() const { return offset_m_; }  ///< from the robot to the path
  Point2 point_at(double along_m) const;
  /// The corners from the present place on, that place first.
  void rest(std::vector<Point2>* points) const;

 private:
  std::vector<Point2> points_;
  std::vector<double> along_m_;
  double at_m_ = 0.0, offset_m_ = 0.0;
};

}  // namespace knav
