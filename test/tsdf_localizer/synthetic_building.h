#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/distance_map.h"
#include "core/pose2.h"
#include "core/range_scan.h"

namespace knav::test {

/// A solid block of a plan, its sides parallel to the axes.
struct Block {
  double x0_m, y0_m, x1_m, y1_m;
};

/// A plan of blocks: rays and distances by formula, with nothing shared with the code under test.
struct Building {
  double width_m = 0.0, height_m = 0.0;
  std::vector<Block> blocks;

  void wall(double x0, double y0, double x1, double y1) { blocks.push_back({x0, y0, x1, y1}); }
  /// Range to the nearest block along the ray; +Inf beyond range_max_m.
  double range(const Point2& from, double angle_rad, double range_max_m) const;
  double signed_distance(const Point2& p) const;
  DistanceMap distance_map(double resolution_m = 0.05) const;
};

/// 24 x 16 m: a corridor, three furnished rooms each side, no two alike.
Building office();
/// Two rooms that are copies of each other, wall to wall, joined by a lane south of both.
Building twin_rooms();

struct ScanModel {
  int rays = 3600;
  double range_max_m = 20.0;
  double noise_m = 0.0;
  double noise_per_range_squared = 0.0;
  double fresh_fov_rad = 2.0 * kPi;  ///< ahead of the robot with evidence 1, the rest with old_evidence
  double old_evidence = 0.3;
  double evidence_decay_s = 30.0;  ///< RememberedView's, instead of old_evidence
  double unknown_fraction = 0.0;  ///< of the old part, in patches of 20 rays
};
RangeScan make_scan(const Building& building, const Pose2& T_map_base, const ScanModel& model, double stamp_s,
                    std::uint64_t seed = 1);

/// What scan_360 shows along a drive: outside of the view, what was seen before, where the motion since then puts it. As in the
/// local map, it has moved with the motion's errors, and its evidence has fallen with its age. (That something may hide it is left
/// out.)
class RememberedView {
 public:
  RememberedView(const Building& building, const ScanModel& model) : building_(building), model_(model) {}
  RangeScan scan(const Pose2& T_map_base, const Pose2& T_odom_base, double stamp_s);

 private:
  struct Seen {
    Pose2 T_map_base, T_odom_base;
    double stamp_s;
  };
  const Building& building_;
  ScanModel model_;
  std::vector<Seen> seen_;
};

/// Drives straight from point to point at 0.5 m/s and turns on the spot at 1 rad/s; one pose every 1/rate_hz.
std::vector<Pose2> drive(const std::vector<Point2>& points, double rate_hz);

/// Odometry of a drive: each step's length and angle wrong by these factors, from another start.
std::vector<Pose2> odometry_of(const std::vector<Pose2>& truth, double length_factor, double angle_factor);

}  // namespace knav::test
