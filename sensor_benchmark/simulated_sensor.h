#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "kinect_sim/camera_mount.h"
#include "kinect_sim/depth_renderer.h"
#include "kinect_sim/kinect_model.h"
#include "kinect_sim/world.h"

namespace knav {

constexpr double kReadout_s = 1.0 / 30.0;  ///< of the simulated sensor, first to last row

/// One simulated Kinect in a world in which nothing moves but the camera, in any way: pitch, roll and bumps,
/// which Simulator's planar robot does not have.
class SimulatedSensor {
 public:
  /// People stand at the first point of their path; doors are as the world file has them.
  SimulatedSensor(const WorldConfig& world, const KinectConfig& kinect, std::uint64_t seed,
                  std::uint64_t device_seed);
  SimulatedSensor(const SimulatedSensor&) = delete;
  SimulatedSensor& operator=(const SimulatedSensor&) = delete;

  const PinholeModel& camera() const { return camera_; }
  /// Where the camera's optical frame is, some seconds after (before, if negative) the frame's stamp.
  using PoseAfterStamp = std::function<Eigen::Isometry3d(double after_s)>;
  /// 16UC1 mm, 0 = invalid; rows read one after another, the stamp means the middle one.
  void sense(std::uint64_t frame, const PoseAfterStamp& T_world_optical, cv::Mat* depth_mm);
  /// 32FC1 m, NaN = nothing there; all rows from the one pose.
  void true_depth(const Eigen::Isometry3d& T_world_optical, cv::Mat* depth_m);

 private:
  PinholeModel camera_;
  WorldMeshes meshes_;
  DepthRenderer renderer_;
  KinectModel kinect_;
  DynamicState state_;
  std::vector<float> z_m_, signal_;
};

/// The nearest thing between 1 cm and slice_top_m above the floor in every column of the levelled camera:
/// what a DepthProfile should say. Worked out point by point from the true depth.
/// @param T_base_optical where the camera truly is; base z = 0 is the floor
void true_profile(const cv::Mat& true_depth_m, const PinholeModel& camera,
                  const Eigen::Isometry3d& T_base_optical, double slice_top_m, std::vector<float>* z_m);

/// How many readings, true or sensed, of each column of the levelled camera lie between two heights above the
/// floor.
void readings_between(const cv::Mat& depth_m, const PinholeModel& camera,
                      const Eigen::Isometry3d& T_base_optical, double bottom_m, double top_m,
                      std::vector<int>* readings);

}  // namespace knav
