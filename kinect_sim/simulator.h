#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "core/pose2.h"
#include "core/pose_buffer.h"
#include "core/range_scan.h"
#include "core/trajectory.h"
#include "kinect_sim/collision_map.h"
#include "kinect_sim/people.h"
#include "kinect_sim/robot_model.h"
#include "kinect_sim/simulator_config.h"
#include "kinect_sim/world.h"

namespace knav {

class DepthRenderer;

/// What was where while one depth frame was read out; enough to render it later or in another thread.
struct FrameRequest {
  std::uint64_t index = 0;
  double stamp_s = 0.0;                       ///< when the row `stamp_row` is read
  std::array<StampedPose2, 16> T_world_base;  ///< over the readout, sorted by stamp
  int pose_count = 0;
  DynamicState dynamic;  ///< people, doors and timed pieces in mid-frame

  Pose2 pose_at(double stamp_s) const;
};

/// Contacts so far.
struct ContactCount {
  std::uint32_t collisions = 0;       ///< the robot ran into something or somebody (or off a stair)
  std::uint32_t walker_contacts = 0;  ///< somebody walked into the robot
  bool touching = false;              ///< now
};

/// The lock-step core: a robot, people and a Kinect in a building. Deterministic: the same world,
/// configuration and sequence of commands give the same bytes. step(), set_command() and the queries belong
/// to one thread; render() and scans may run in one other thread, as all they need is in the request.
class Simulator {
 public:
  Simulator(const WorldConfig& world, const SimulatorConfig& config);
  ~Simulator();
  Simulator(const Simulator&) = delete;
  Simulator& operator=(const Simulator&) = delete;

  const WorldConfig& world() const { return world_; }
  const SimulatorConfig& config() const { return config_; }
  const PinholeModel& camera() const;
  /// Camera (x forward, z up) in the base, and its optical frame follows REP 103.
  Eigen::Isometry3d T_base_camera() const;
  Eigen::Isometry3d T_base_optical() const;

  /// Forward [m/s] and turning [rad/s] speed wanted; holds until the next one or
  /// config().robot.command_timeout_s.
  void set_command(double v_mps, double w_radps);
  /// Advances by config().step_s.
  void step();
  /// Stamp of now: config().start_time_s + the time simulated.
  double stamp_s() const;

  const Pose2& T_world_base() const { return robot_.T_world_base(); }
  const Pose2& T_odom_base() const { return robot_.T_odom_base(); }
  const RobotModel& robot() const { return robot_; }
  const std::vector<PersonState>& people() const { return dynamic_.people; }
  /// In words, for reports: what is nearest to the robot.
  std::string nearest_thing() const;
  const ContactCount& contacts() const { return contacts_; }
  double distance_driven_m() const { return distance_driven_m_; }

  /// True once for every frame whose last row has been read; call after every step().
  bool next_frame(FrameRequest* request);
  /// What a scan taken now sees.
  void request_now(FrameRequest* request) const;
  /// 16UC1 mm, 0 = invalid. Allocates only if the image has not the right size yet.
  void render(const FrameRequest& request, cv::Mat* depth_mm);
  /// 16UC1, 10 bits: the IR image of the same instant, through infrared_camera().
  void render_infrared(const FrameRequest& request, cv::Mat* infrared);
  PinholeModel infrared_camera() const;
  /// 32FC1 m of the true depth along the optical axis, NaN = nothing; same rolling shutter, no sensor faults.
  void render_true_depth(const FrameRequest& request, cv::Mat* depth_m);
  /// The planar LIDAR (180 deg, 361 rays, noise) at its mount T_base_laser().
  void scan_lidar(const FrameRequest& request, RangeScan* scan);
  /// A perfect scan all round at a height above base_link, 3,600 rays.
  void scan_perfect(const FrameRequest& request, double height_m, RangeScan* scan);
  /// True distance along the camera's optical axis; +Inf if there is nothing within 50 m.
  float range_ahead_m(const FrameRequest& request);
  Pose2 T_base_laser() const;

  /// Puts the robot elsewhere (kidnaps it): odometry does not notice. UserError if something stands there, or nearer to its rim than
  /// `room_m`.
  void set_pose(const Pose2& T_world_base, double room_m = 0.0);
  /// Odometry goes on from there: a robot that comes from another building.
  void set_odometry(const Pose2& T_odom_base) { robot_.set_odometry(T_odom_base); }
  /// Robot, people and counters as at the start; time and odometry go on.
  void reset();

 private:
  struct Rendering;
  void move_doors();
  /// Between the robot's rim and the nearest solid or person; negative = overlapping.
  double gap_m(const Pose2& pose) const;
  template <class Row>
  void for_each_row(const FrameRequest& request, DepthRenderer& renderer, int rows, const Row& row);
  void cast_scan(const FrameRequest& request, const Pose2& T_world_sensor, double height_m, int rays,
                 RangeScan* scan);

  WorldConfig world_;
  SimulatorConfig config_;
  RobotModel robot_;
  CollisionMap collision_map_;
  People crowd_;
  DynamicState dynamic_;
  ContactCount contacts_;
  std::unique_ptr<Rendering> rendering_;
  PoseBuffer truth_;
  std::uint64_t steps_ = 0, next_frame_ = 0, command_step_ = 0;
  double reset_time_s_ = 0.0, distance_driven_m_ = 0.0;
};

}  // namespace knav
