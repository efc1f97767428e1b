#pragma once

#include <vector>

#include "core/pose2.h"
#include "core/range_scan.h"
#include "planner_tracker/combined_map.h"

namespace knav {

/// What scan_360 says about the robot's neighbourhood. REP 117: a return is an obstacle, +Inf was seen free,
/// NaN is unknown and says nothing here; whoever asks about clearance asks the combined map as well.
class ScanView {
 public:
  /// @param near_m  returns farther from the robot than this do not matter
  ScanView(double near_m, double reach_m);

  void clear();
  bool empty() const { return ranges_.range_m.empty(); }
  double stamp_s() const { return ranges_.stamp_s; }
  void set(const RangeScan& scan, const Pose2& T_base_sensor);
  /// Where odometry had the robot at the scan's stamp; then where it is now. Call before the questions below.
  void place(const Pose2& T_odom_base_then, const Pose2& T_odom_base_now);

  /// From a point of the robot's frame to the nearest return [m]; at most the reach. Exact up to 0.5 m, by cells of
  /// 4 cm beyond.
  double clearance_m(double x_m, double y_m) const;
  /// How far a disc of this radius may go straight in a direction of the robot's frame [m] before it meets a
  /// return.
  /// @param unknown_ends  a direction with an unknown ray within 20 deg of it gives 0
  double free_m(double bearing_rad, double radius_m, bool unknown_ends) const;

 private:
  void sort_returns();
  double exact_clearance_m(double x_m, double y_m, double most_m) const;

  RangeScan ranges_;
  Pose2 T_base_sensor_;
  Pose2 T_now_sensor_;  ///< of the scan, in the present robot's frame
  MapLayer window_;     ///< round the robot, in its frame
  TruncatedDistance distance_;
  // The returns in the window, by cell: those of cell i are sorted_[first_[i]] to sorted_[first_[i + 1]].
  std::vector<Point2> returns_, sorted_;
  std::vector<std::size_t> cell_;
  std::vector<std::size_t> first_;
};

}  // namespace knav
