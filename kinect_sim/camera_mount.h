#pragma once

#include <Eigen/Geometry>

#include "core/camera_model.h"
#include "core/pose2.h"

namespace knav {

/// The simulated Kinect's camera, without lens distortion.
PinholeModel kinect_camera();

/// The camera (x forward, z up) in the base. Positive yaw looks left, positive pitch down, positive roll
/// lowers its right side.
Eigen::Isometry3d camera_mount(const Eigen::Vector3d& position_m, double yaw_deg, double pitch_deg,
                               double roll_deg);
/// The optical frame (REP 103: x right, y down, z forward) of a camera whose x looks forward.
Eigen::Isometry3d optical_frame(const Eigen::Isometry3d& T_a_camera);

/// A pose on the floor, in space.
Eigen::Isometry3d isometry(const Pose2& pose);

}  // namespace knav
