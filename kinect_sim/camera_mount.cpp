#include "kinect_sim/camera_mount.h"

namespace knav {

PinholeModel kinect_camera() { return {640, 480, 585.0, 585.0, 319.5, 239.5}; }

Eigen::Isometry3d camera_mount(const Eigen::Vector3d& position_m, double yaw_deg, double pitch_deg,
                               double roll_deg) {
  constexpr double kDegree = kPi / 180.0;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() = position_m;
  T.linear() = (Eigen::AngleAxisd(yaw_deg * kDegree, Eigen::Vector3d::UnitZ()) *
                Eigen::AngleAxisd(pitch_deg * kDegree, Eigen::Vector3d::UnitY()) *
                Eigen::AngleAxisd(roll_deg * kDegree, Eigen::Vector3d::UnitX()))
                   .toRotationMatrix();
  return T;
}

Eigen::Isometry3d optical_frame(const Eigen::Isometry3d& T_a_camera) {
  Eigen::Matrix3d R_camera_optical;
  R_camera_optical << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  Eigen::Isometry3d T = T_a_camera;
  T.linear() = T.linear() * R_camera_optical;
  return T;
}

Eigen::Isometry3d isometry(const Pose2& pose) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << pose.x_m, pose.y_m, 0.0;
  T.linear() = Eigen::AngleAxisd(pose.yaw_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return T;
}

}  // namespace knav
