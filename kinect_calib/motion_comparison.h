#pragma once

#include <string>
#include <vector>

#include "core/trajectory.h"
#include "kinect_calib/level_scan.h"

namespace knav {

/// A figure and its standard error.
struct Estimate {
  double value = 0.0, sd = 0.0;
};

/// What the camera's own motion says of odometry and of the camera's place on the robot.
struct MotionComparison {
  int motions = 0;               ///< scan pairs that odometry covers
  double turned_rad = 0.0;       ///< by odometry, to both sides
  double turned_left_rad = 0.0;  ///< of these, to the left
  double driven_m = 0.0;

  bool turn_known = false;  ///< the next two are set
  Estimate time_offset_s;   ///< added to a depth stamp gives odometry's time
  Estimate turn_scale;      ///< true turn / odometry's; negative: odometry turns the wrong way

  bool drive_known = false;    ///< the next four are set
  Estimate yaw_rad;            ///< of the camera, positive looks left
  Estimate distance_scale;     ///< true distance / odometry's
  Estimate forward_m, left_m;  ///< the camera, from the point about which odometry turns
};

/// Compares camera motions with odometry.
///
/// Time offset and turning scale: camera turns = scale x odometry's turns between the shifted stamps, which
/// tells the offset where the speed of turning differs between the two stamps (starts, stops). Mount:
/// t_camera = R(-yaw) (distance_scale t_odom + (R - 1) t_mount), linear in what is sought (planar hand-eye
/// calibration). Both by Huber's reweighting, each motion with the information of its alignment; standard
/// errors by leaving out one of ten stretches of the drive at a time (jackknife), as neighbouring motions
/// share their errors.
///
/// @param odometry T_map_robot holds T_odom_base; sorted by stamp
MotionComparison compare_motions(const std::vector<ScanMotion>& motions, const Trajectory& odometry);

}  // namespace knav
