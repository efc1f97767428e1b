#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <string>

#include "brin_benchmark/navigation_stack_config.h"
#include "brin_benchmark/stage_costs.h"
#include "core/camera_model.h"
#include "core/pose_buffer.h"
#include "depth_profile_nodelet/front_end.h"
#include "global_map_builder/map_directory.h"
#include "planner_tracker/planner_tracker.h"
#include "tsdf_local_mapper/local_mapper.h"
#include "tsdf_localizer/localizer.h"

namespace knav {

/// The sections of a configuration file that the stack on the robot reads.
struct NavigationStackConfig {
  FrontEndConfig front_end;
  LocalMapperConfig local_mapper;
  LocalizerConfig localizer;
  PlannerTrackerConfig planner_tracker;
  NavigationInputConfig input;

  /// UserError names the file, section and key at fault.
  static NavigationStackConfig from_file(const std::string& path);
};

/// What runs on the robot, without ROS: the classes of the nodelets, called in the order of the graph and
/// without its delays. Driven in lock-step by the benchmark.
class NavigationStack {
 public:
  explicit NavigationStack(const NavigationStackConfig& config);

  void set_map(const MapDirectory& map);
  /// Somebody says where the robot is (start, or set down after a failure): motion and local map begin anew.
  void place(const Pose2& T_map_base);

  void add_odometry(double stamp_s, const Pose2& T_odom_base, double v_mps, double w_radps);
  /// One depth frame through front end, local mapper and localizer. Odometry must reach its stamp.
  void add_depth(const cv::Mat& depth, const PinholeModel& camera, double stamp_s,
                 const Eigen::Isometry3d& T_base_optical);

  /// False, with failure(), if the goal cannot be.
  bool set_goal(const Pose2& T_map_goal) { return planner_.set_goal(T_map_goal); }
  void cancel() { planner_.cancel(); }
  Command control(double now_s);
  const Failure& failure() const { return planner_.failure(); }

  /// Where the robot believes it is at the newest odometry; false before the first scan was localized.
  bool estimate(Pose2* T_map_base) const;
  LocalizationVerdict verdict() const { return localizer_.result().verdict; }

  /// Of the newest frame, for a record of what led to a failure.
  const DepthProfile& profile() const { return profile_; }
  const RangeScan& scan() const { return scan_; }
  const LocalizerResult& localization() const { return localizer_.result(); }
  const PlannerTracker& planner() const { return planner_; }
  const StageCosts& costs() const { return costs_; }

 private:
  void localize(const Pose2& T_base_sensor, const Pose2& T_local_base, std::uint32_t epoch,
                const Pose2& T_odom_base, StageTimer* timer);

  NavigationInputConfig input_;
  DepthProfileConfig profile_config_;
  FrontEnd front_end_;
  LocalMapper mapper_;
  Localizer localizer_;
  PlannerTracker planner_;
  PoseBuffer odometry_;
  DepthProfile profile_;
  RangeScan scan_;
  OccupancyGrid local_map_;
  Pose2 T_odom_base_;
  double odometry_stamp_s_ = 0.0, v_mps_ = 0.0, w_radps_ = 0.0;
  bool localized_ = false;
  std::uint32_t odometry_epoch_ = 0;  ///< the robot was set down elsewhere
  Pose2 T_map_odom_;
  StageCosts costs_;
};

}  // namespace knav
