#include "brin_benchmark/navigation_stack.h"

#include "core/config.h"
#include "tsdf_localizer/localizer_node_config.h"

namespace knav {
namespace {

/// A person who sets a robot down knows the place this well.
Eigen::Matrix3d placing_covariance() {
  return Eigen::Vector3d(0.1 * 0.1, 0.1 * 0.1, 0.05 * 0.05).asDiagonal();
}

LocalizationState localization_state(LocalizationVerdict verdict) {
  switch (verdict) {
    case LocalizationVerdict::kOk:
      return LocalizationState::kOk;
    case LocalizationVerdict::kUncertain:
      return LocalizationState::kUncertain;
    case LocalizationVerdict::kLost:
      return LocalizationState::kLost;
    case LocalizationVerdict::kInitializing:
      break;
  }
  return LocalizationState::kInitializing;
}

/// The levelled camera's pose in the plane.
Pose2 planar(const Eigen::Isometry3d& T_base_optical) {
  const Eigen::Vector3d forward = T_base_optical.rotation().col(2);
  return {T_base_optical.translation().x(), T_base_optical.translation().y(),
          std::atan2(forward.y(), forward.x())};
}

}  // namespace

NavigationStackConfig NavigationStackConfig::from_file(const std::string& path) {
  NavigationStackConfig config;
  config.front_end = FrontEndConfig::from_file(path);
  config.local_mapper = read_config_section<LocalMapperConfig>(path, "local_mapper");
  config.localizer = read_config_section<LocalizerNodeConfig>(path, "localizer").localizer;
  config.input = read_config_section<NavigationInputConfig>(path, "navigation");
  config.planner_tracker = read_config_section<PlannerTrackerConfig>(path, "planner_tracker");
  return config;
}

NavigationStack::NavigationStack(const NavigationStackConfig& config)
    : input_(config.input),
      profile_config_(config.front_end.depth_profile),
      front_end_(config.front_end),
      mapper_(config.local_mapper),
      localizer_(config.localizer),
      planner_(config.planner_tracker) {}

void NavigationStack::set_map(const MapDirectory& map) {
  localizer_.set_map(map.distance);
  planner_.set_map(map.distance, map.occupancy, map.keepout);
}

void NavigationStack::place(const Pose2& T_map_base) {
  mapper_.reset();
  front_end_.reset();
  odometry_.clear();
  planner_.clear_local_map();
  localizer_.initialize(T_map_base, placing_covariance());
  localized_ = false;
  ++odometry_epoch_;
}

void NavigationStack::add_odometry(double stamp_s, const Pose2& T_odom_base, double v_mps, double w_radps) {
  mapper_.add_odometry(stamp_s, T_odom_base);
  odometry_.add(stamp_s, T_odom_base);
  T_odom_base_ = T_odom_base;
  odometry_stamp_s_ = stamp_s;
  v_mps_ = v_mps;
  w_radps_ = w_radps;
}

void NavigationStack::add_depth(const cv::Mat& depth, const PinholeModel& camera, double stamp_s,
                                const Eigen::Isometry3d& T_base_optical) {
  StageTimer timer(&costs_);
  const bool usable = front_end_.process(depth, camera, stamp_s, T_base_optical, odometry_, &profile_);
  timer.done(Stage::kFrontEnd);
  if (!usable) return;
  const Pose2 T_base_camera = planar(T_base_optical);
  if (input_.localize_with == "scan") {
    Pose2 T_odom_base;
    if (odometry_.at(stamp_s, 1.0, 0.2, &T_odom_base) != PoseBuffer::Lookup::kOk) return;
    scan_from_profile(profile_, profile_config_, &scan_);
    timer.done(Stage::kVirtualScan);
    localize(T_base_camera, T_odom_base, odometry_epoch_, T_odom_base, &timer);
    if (!input_.local_map) return;
  }
  const LocalMapperResult& motion = mapper_.update(profile_, T_base_camera);
  timer.done(Stage::kLocalMapper);
  if (!motion.accepted) return;
  if (input_.localize_with == "scan_360") {
    mapper_.extract_scan_360(&scan_);
    timer.done(Stage::kVirtualScan);
    localize(Pose2{}, motion.T_local_base, motion.epoch, motion.T_odom_base, &timer);
  }
  if (!localized_ || !input_.local_map) return;
  mapper_.extract_local_map(&local_map_);
  planner_.set_local_map(local_map_, T_map_odom_ * motion.T_odom_base * motion.T_local_base.inverse());
  timer.done(Stage::kLocalMap);
}

void NavigationStack::localize(const Pose2& T_base_sensor, const Pose2& T_local_base, std::uint32_t epoch,
                               const Pose2& T_odom_base, StageTimer* timer) {
  const LocalizerResult& pose = localizer_.update(scan_, T_base_sensor, T_local_base, epoch, &T_odom_base);
  timer->done(Stage::kLocalizer);
  mapper_.set_in_doubt(pose.verdict != LocalizationVerdict::kOk);
  planner_.set_scan(scan_, T_base_sensor);
  if (!pose.has_pose) return;
  localized_ = true;
  T_map_odom_ = pose.T_map_base * T_odom_base.inverse();
}

Command NavigationStack::control(double now_s) {
  RobotState robot;
  robot.has_pose = estimate(&robot.T_map_base);
  robot.pose_stamp_s = localizer_.result().stamp_s;
  robot.odom_stamp_s = odometry_stamp_s_;
  robot.T_odom_base = T_odom_base_;
  robot.v_mps = v_mps_;
  robot.w_radps = w_radps_;
  robot.localization = localization_state(verdict());
  robot.localization_stamp_s = localizer_.result().stamp_s;
  StageTimer timer(&costs_);
  Command command = planner_.step(now_s, robot);
  timer.done(Stage::kPlanner);
  return command;
}

bool NavigationStack::estimate(Pose2* T_map_base) const {
  if (!localized_) return false;
  *T_map_base = T_map_odom_ * T_odom_base_;
  return true;
}

}  // namespace knav
