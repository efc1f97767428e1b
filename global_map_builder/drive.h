#pragma once

#include <Eigen/Core>
#include <string>
#include <variant>
#include <vector>

#include "core/depth_profile.h"
#include "core/range_scan.h"
#include "core/trajectory.h"
#include "core/tsdf_observation.h"
#include "global_map_builder/pose_graph.h"

namespace knav {

/// A frame kept for the map.
struct DriveFrame {
  double stamp_s = 0.0;
  double path_m = 0.0;
  Pose2 T_drive_base;
  Pose2 T_odom_base;
  Pose2 T_base_sensor;
  std::variant<DepthProfile, RangeScan> data;
};

/// A node of the pose graph.
struct Keyframe {
  double stamp_s = 0.0;
  double path_m = 0.0;
  Pose2 T_drive_base;
  Pose2 T_odom_base;
  bool after_break = false;  ///< the mapper lost the thread before it; the edge to here is odometry's
  bool marked = false;       ///< the button was pressed here
};

/// One drive without interruption, in a frame of its own: the first pose is the origin.
struct Drive {
  std::string name;  ///< of the recording
  std::vector<DriveFrame> frames;
  std::vector<Keyframe> keyframes;
  std::vector<PoseGraphEdge> edges;  ///< from each keyframe to the next, by their indices here
  Trajectory trajectory;             ///< T_drive_base of every accepted frame
  Trajectory odometry;               ///< T_odom_base at the same stamps
  int breaks = 0;                    ///< times the mapper lost the thread

  /// Moves the keyframes, and with them frames and trajectory; edges become the steps between the new poses.
  /// @param T_drive_keyframe one per keyframe
  /// @param step_covariance added to each edge's own; one per edge
  void adjust(const std::vector<Pose2>& T_drive_keyframe,
              const std::vector<Eigen::Matrix3d>& step_covariance);
};

/// What the frames within `half_length_m` of path before and after a keyframe saw, with poses relative to it.
std::vector<TsdfObservation> observations_near(const Drive& drive, int keyframe, double half_length_m,
                                               const ObservationLimits& limits);

}  // namespace knav
