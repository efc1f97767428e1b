#pragma once

#include <Eigen/Core>
#include <string>
#include <variant>
#include <vector>

#include "core/trajectory.h"
#include "global_map_builder/map_builder_config.h"
#include "global_map_builder/pose_graph.h"
#include "tsdf_local_mapper/local_mapper.h"

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

/// A node of the pose graph; its number is its index.
struct Keyframe {
  double stamp_s = 0.0;
  double path_m = 0.0;
  Pose2 T_drive_base;
  Pose2 T_odom_base;
  bool after_break = false;  ///< the mapper lost the thread before it; the edge to here is odometry's
  bool marked = false;       ///< the button was pressed here
};

/// Runs the local mapper along a recording and keeps what the map is made of. Poses are in the frame `drive`:
/// the mapper's, carried over its epochs by odometry, with the first pose as origin.
class DriveRecorder {
 public:
  DriveRecorder(const DriveConfig& config, const LocalMapperConfig& mapper);

  void add_odometry(double stamp_s, const Pose2& T_odom_base) { mapper_.add_odometry(stamp_s, T_odom_base); }
  void add(const DepthProfile& profile, const Pose2& T_base_camera) { take(profile, T_base_camera); }
  void add(const RangeScan& scan, const Pose2& T_base_sensor) { take(scan, T_base_sensor); }
  /// The next frame stands at a marked place.
  void mark(double /*stamp_s*/) { mark_pending_ = true; }

  /// Moves the keyframes, and with them frames and trajectory; edges become the steps between the new poses.
  /// @param T_drive_keyframe one per keyframe
  /// @param step_covariance added to each edge's own; one per edge
  void adjust(const std::vector<Pose2>& T_drive_keyframe,
              const std::vector<Eigen::Matrix3d>& step_covariance);

  const std::vector<DriveFrame>& frames() const { return frames_; }
  const std::vector<Keyframe>& keyframes() const { return keyframes_; }
  const Trajectory& trajectory() const { return trajectory_; }  ///< T_drive_base of every accepted frame
  const Trajectory& odometry() const { return odometry_; }      ///< T_odom_base at the same stamps
  const std::vector<PoseGraphEdge>& edges() const { return edges_; }  ///< from each keyframe to the next
  std::size_t refused() const { return refused_; }
  const std::string& last_refusal() const { return last_refusal_; }
  int breaks() const { return breaks_; }

 private:
  template <class Observation>
  void take(const Observation& observation, const Pose2& T_base_sensor);
  void add_keyframe(const LocalMapperResult& result, const Pose2& T_drive_base);

  DriveConfig config_;
  LocalMapper mapper_;
  std::vector<DriveFrame> frames_;
  std::vector<Keyframe> keyframes_;
  std::vector<PoseGraphEdge> edges_;
  Trajectory trajectory_, odometry_;
  Pose2 T_drive_local_;
  std::uint32_t epoch_ = 0;
  double path_m_ = 0.0;
  bool break_pending_ = false, mark_pending_ = false;
  int breaks_ = 0;
  std::size_t refused_ = 0;
  std::string last_refusal_;
};

}  // namespace knav
