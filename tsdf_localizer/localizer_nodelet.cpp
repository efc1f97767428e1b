#include "tsdf_localizer/localizer_nodelet.h"

#include <fmt/format.h>
#include <geometry_msgs/PoseArray.h>
#include <tf2_geometry_msgs/tf2_geometry_msgs.h>

#include <algorithm>
#include <cmath>
#include <pluginlib/class_list_macros.hpp>

#include "core/error.h"
#include "core/occupancy_distance.h"
#include "ros_common/conversions.h"
#include "ros_common/parameters.h"
#include "tsdf_localizer/map_fields.h"
#include "tsdf_localizer/scan_rays.h"

namespace knav {
namespace {

constexpr double kComplainEvery_s = 5.0;
constexpr int kCovarianceRows[3] = {0, 1, 5};  // x, y and yaw of ROS's 6 x 6

Eigen::Matrix3d planar(const boost::array<double, 36>& covariance) {
  Eigen::Matrix3d m;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      m(i, k) = covariance[static_cast<std::size_t>(6 * kCovarianceRows[i] + kCovarianceRows[k])];
    }
  }
  return m;
}

}  // namespace

void LocalizerNodelet::start() {
  ros::NodeHandle& nh = getNodeHandle();
  ros::NodeHandle& private_nh = getPrivateNodeHandle();
  config_ = read_parameters<LocalizerNodeConfig>(private_nh);
  saved_pose_file_ = saved_pose_path(config_.saved_pose_file);
  localizer_ = std::make_unique<Localizer>(config_.localizer);
  broadcaster_ = std::make_unique<MapOdomBroadcaster>(config_.global_frame_id, config_.odom_frame_id,
                                                      config_.transform_tolerance, config_.slew);
  diagnostics_ = std::make_unique<LocalizerDiagnostics>(nh, private_nh, getName());
  inbox_ = std::make_unique<ScanInbox>(config_, tf_);
  listener_ = std::make_unique<tf2_ros::TransformListener>(tf_);
  last_scan_wall_ = ros::WallTime::now();

  pose_pub_ = nh.advertise<geometry_msgs::PoseWithCovarianceStamped>("amcl_pose", 2, true);
  cloud_pub_ = nh.advertise<geometry_msgs::PoseArray>("particlecloud", 2, true);
  status_pub_ = nh.advertise<kinect_nav::LocalizationStatus>("localization_status", 2, true);
  global_srv_ = nh.advertiseService<std_srvs::EmptyRequest, std_srvs::EmptyResponse>(
      "global_localization", [this](std_srvs::EmptyRequest&, std_srvs::EmptyResponse&) {
        NODELET_INFO("localizer: searching the whole map, as asked.");
        localizer_->initialize_globally();
        return true;
      });
  nomotion_srv_ = nh.advertiseService<std_srvs::EmptyRequest, std_srvs::EmptyResponse>(
      "request_nomotion_update", [this](std_srvs::EmptyRequest&, std_srvs::EmptyResponse&) {
        localizer_->force_update();
        return true;
      });
  set_map_srv_ = nh.advertiseService("set_map", &LocalizerNodelet::on_set_map, this);
  initial_pose_sub_ = nh.subscribe("initialpose", 2, &LocalizerNodelet::on_initial_pose, this);
  distance_map_sub_ = nh.subscribe("distance_map", 1, &LocalizerNodelet::on_distance_map, this);
  map_sub_ = nh.subscribe("map", 1, &LocalizerNodelet::on_map, this);
  motion_sub_ = nh.subscribe("motion_estimate", 50, &LocalizerNodelet::on_motion, this);
  scan_sub_ = nh.subscribe("scan_360", 5, &LocalizerNodelet::on_scan, this);
  timer_ = nh.createWallTimer(ros::WallDuration(1.0 / config_.tf_rate_hz),
                              [this](const ros::WallTimerEvent&) { on_timer(); });
}

LocalizerNodelet::~LocalizerNodelet() {
  if (localizer_) remember_pose(0.0, true);
}

void LocalizerNodelet::on_distance_map(const kinect_nav::DistanceMapConstPtr& message) {
  try {
    const DistanceMap map = distance_map_from(*message);
    if (has_distance_map_ && checksum_of(map) == checksum_) return;  // the same once more
    has_distance_map_ = take_map(map, distance_map_sub_.getTopic()) || has_distance_map_;
  } catch (const UserError& error) {
    NODELET_ERROR("localizer: %s: %s", distance_map_sub_.getTopic().c_str(), error.what());
  }
}

void LocalizerNodelet::on_map(const nav_msgs::OccupancyGridConstPtr& message) {
  if (has_distance_map_) return;  // the better one of the same map server
  try {
    const DistanceMap map = distance_from_occupancy(occupancy_from(*message));
    if (localizer_->has_map() && checksum_of(map) == checksum_) return;
    take_map(map, map_sub_.getTopic());
  } catch (const UserError& error) {
    NODELET_ERROR("localizer: %s: %s", map_sub_.getTopic().c_str(), error.what());
  }
}

bool LocalizerNodelet::take_map(const DistanceMap& map, const std::string& source) {
  const bool first = !localizer_->has_map();
  const ros::WallTime begin_time = ros::WallTime::now();
  localizer_->set_map(map);
  checksum_ = checksum_of(map);
  NODELET_INFO("localizer: map from %s, %d x %d cells of %.3f m, ready in %.2f s.", source.c_str(),
               map.geometry.width_cells, map.geometry.height_cells, map.geometry.resolution_m,
               (ros::WallTime::now() - begin_time).toSec());
  if (first && !localizer_->initialized()) begin();
  return true;
}

void LocalizerNodelet::begin() {
  if (const auto pose = config_.initial_pose()) {
    localizer_->initialize(*pose, config_.initial_covariance());
    NODELET_INFO("localizer: starting from initial_pose_x, _y, _a = %.2f, %.2f, %.2f.", pose->x_m, pose->y_m,
                 pose->yaw_rad);
    return;
  }
  try {
    const auto saved = load_saved_pose(saved_pose_file_);
    if (saved && saved->map_checksum == checksum_) {
      localizer_->initialize(saved->T_map_base, config_.initial_covariance(), Localizer::Trust::kSaved);
      NODELET_INFO("localizer: trying the pose saved in %s: %.2f, %.2f, %.2f.", saved_pose_file_.c_str(),
                   saved->T_map_base.x_m, saved->T_map_base.y_m, saved->T_map_base.yaw_rad);
      return;
    }
  } catch (const UserError& error) {
    NODELET_WARN("localizer: %s", error.what());
  }
  localizer_->initialize_globally();
  NODELET_INFO("localizer: no initial pose; searching the whole map.");
}

bool LocalizerNodelet::take_pose(const geometry_msgs::PoseWithCovarianceStamped& message,
                                 const std::string& source) {
  const std::string frame = without_slash(message.header.frame_id);
  if (!frame.empty() && frame != config_.global_frame_id) {
    NODELET_WARN("localizer: %s ignored: it is in frame '%s'; poses must be in '%s'.", source.c_str(),
                 frame.c_str(), config_.global_frame_id.c_str());
    return false;
  }
  const auto& q = message.pose.pose.orientation;
  const double norm = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  Pose2 T_map_base = pose2_from(message.pose.pose);
  Eigen::Matrix3d covariance = planar(message.pose.covariance);
  if (!is_finite(T_map_base) || !covariance.allFinite() || !(norm > 0.01)) {
    NODELET_WARN(
        "localizer: %s ignored: its pose or covariance is not finite, or its orientation is no rotation.",
        source.c_str());
    return false;
  }
  if (covariance.isZero()) {
    covariance =
        Eigen::Vector3d(config_.initial_cov_xx, config_.initial_cov_yy, config_.initial_cov_aa).asDiagonal();
  }
  // As amcl: the robot may have moved since the pose's stamp.
  if (!message.header.stamp.isZero()) {
    try {
      const auto T = tf_.lookupTransform(config_.base_frame_id, message.header.stamp, config_.base_frame_id,
                                         ros::Time(0), config_.odom_frame_id);
      T_map_base = T_map_base * pose2_from(T.transform);
    } catch (const tf2::TransformException&) {
      // It has hardly moved since: poses are given by hand.
    }
  }
  localizer_->initialize(T_map_base, covariance);
  NODELET_INFO("localizer: pose from %s: %.2f, %.2f, %.2f.", source.c_str(), T_map_base.x_m, T_map_base.y_m,
               T_map_base.yaw_rad);
  return true;
}

void LocalizerNodelet::on_initial_pose(const geometry_msgs::PoseWithCovarianceStampedConstPtr& pose) {
  take_pose(*pose, initial_pose_sub_.getTopic());
}

bool LocalizerNodelet::on_set_map(nav_msgs::SetMap::Request& request, nav_msgs::SetMap::Response& response) {
  try {
    const OccupancyGrid occupancy = occupancy_from(request.map);
    if (has_distance_map_ && shows_the_same(localizer_->map(), occupancy)) {
      // the map server's load_map calls this with the occupancy of the map whose better distances are here already
      NODELET_INFO("localizer: set_map brings the map that is used; only its pose is taken.");
      response.success = take_pose(request.initial_pose, "set_map");
      return true;
    }
    response.success = take_map(distance_from_occupancy(occupancy), "set_map") && take_pose(request.initial_pose, "set_map");
    has_distance_map_ = true;  // as amcl: what set_map gave is not replaced by the topic's map
  } catch (const UserError& error) {
    NODELET_ERROR("localizer: set_map: %s", error.what());
    response.success = false;
  }
  return true;
}

bool LocalizerNodelet::clock_jumped_back(double now_s) {
  if (!scan_clock_.jumped_back(now_s)) return false;
  NODELET_WARN("localizer: the clock jumped back; starting anew.");
  late_transforms_.clock_jumped_back();
  // tf2's listener clears the buffer by itself when ROS time jumps, but not when only the stamps do
  try {
    const auto T = tf_.lookupTransform(config_.odom_frame_id, config_.base_frame_id, ros::Time(0));
    if (T.header.stamp.toSec() > now_s + 1.0) tf_.clear();
  } catch (const tf2::TransformException&) {
  }
  inbox_->clear();
  broadcaster_->forget();
  localizer_->reset();
  if (localizer_->has_map()) begin();
  return true;
}

void LocalizerNodelet::on_scan(const sensor_msgs::LaserScanConstPtr& scan) {
  clock_jumped_back(scan->header.stamp.toSec());
  last_scan_wall_ = ros::WallTime::now();
  inbox_->add(scan);
  process_scans();
}

void LocalizerNodelet::on_motion(const kinect_nav::MotionEstimateConstPtr& motion) {
  clock_jumped_back(motion->header.stamp.toSec());
  inbox_->add(motion);
  process_scans();
}

void LocalizerNodelet::on_timer() {
  const ros::Time now = ros::Time::now();
  if (timer_clock_.jumped_back(now.toSec())) {
    broadcaster_->forget();
    late_transforms_.clock_jumped_back();
  }
  late_transforms_.step();
  process_scans();
  if (config_.tf_broadcast) broadcaster_->send(now);
  const double silent_s = (ros::WallTime::now() - last_scan_wall_).toSec();
  if (silent_s > config_.scan_timeout_s &&
      (ros::WallTime::now() - last_status_wall_).toSec() > config_.scan_timeout_s) {
    LocalizerResult stale = localizer_->result();
    if (stale.verdict == LocalizationVerdict::kOk) stale.verdict = LocalizationVerdict::kUncertain;
    stale.stamp_s = now.toSec();
    stale.reason = fmt::format("no scan on {} for {:.0f} s", scan_sub_.getTopic(), silent_s);
    if (!localizer_->has_map()) stale.reason += ", and no map yet";
    NODELET_WARN_THROTTLE(kComplainEvery_s, "localizer: %s.", stale.reason.c_str());
    publish_status(stale);
  }
}

void LocalizerNodelet::process_scans() {
  ScanInput input;
  std::string why;
  for (;;) {
    const ScanInbox::Outcome outcome = inbox_->next(&input, &why);
    if (outcome == ScanInbox::Outcome::kNothing) return;
    if (outcome == ScanInbox::Outcome::kDropped) {
      NODELET_WARN_THROTTLE(kComplainEvery_s, "localizer: %s", why.c_str());
    } else {
      process(input);
    }
  }
}

void LocalizerNodelet::process(const ScanInput& input) {
  scan_from(*input.scan, &scan_);
  if (config_.intensities == "ignore") scan_.evidence.clear();
  if (config_.intensities == "auto") drop_intensities_that_are_not_evidence(&scan_);
  const ros::WallTime begin_time = ros::WallTime::now();
  const LocalizerResult& result =
      localizer_->update(scan_, input.T_base_sensor, input.T_local_base, input.epoch,
                         input.T_odom_base ? &*input.T_odom_base : nullptr);
  diagnostics_->update((ros::WallTime::now() - begin_time).toSec());
  if (!result.accepted) {
    if (!localizer_->has_map()) {
      NODELET_WARN_THROTTLE(kComplainEvery_s, "localizer: scans come but no map yet; waiting for %s or %s.",
                            distance_map_sub_.getTopic().c_str(), map_sub_.getTopic().c_str());
    } else {
      NODELET_WARN_THROTTLE(kComplainEvery_s, "localizer: scan on %s left out: %s.",
                            scan_sub_.getTopic().c_str(), result.reason.c_str());
    }
    publish_status(result);
    return;
  }
  publish(result);
  remember_pose(result.stamp_s, false);
  if (!result.has_pose) return;
  if (input.T_odom_base) {
    correct(result, *input.T_odom_base);
  } else {
    NODELET_WARN_THROTTLE(
        kComplainEvery_s,
        "localizer: no transform from '%s' to '%s' at the scan's stamp; map->odom stays as it was.",
        config_.odom_frame_id.c_str(), config_.base_frame_id.c_str());
  }
}

void LocalizerNodelet::correct(const LocalizerResult& result, const Pose2& T_odom_base) {
  if (broadcaster_->known() && result.filter_updated) {
    const Correction correction = rate_correction(broadcaster_->T_map_odom(), result.T_map_base * T_odom_base.inverse(),
                                                  T_odom_base, position_sd_m_, yaw_sd_rad_);
    diagnostics_->correction(correction);
    const std::string text = "localizer: " + correction.sentence() + ".";
    if (correction.rating == Correction::Rating::kSmall) {
      NODELET_DEBUG("%s", text.c_str());
    } else if (correction.rating == Correction::Rating::kNotable) {
      NODELET_INFO("%s", text.c_str());
    } else {
      NODELET_WARN("%s", text.c_str());
    }
  }
  position_sd_m_ = result.position_sd_m;
  yaw_sd_rad_ = result.yaw_sd_rad;
  broadcaster_->set(result.T_map_base, T_odom_base);
}

void LocalizerNodelet::publish(const LocalizerResult& result) {
  publish_status(result);
  log_verdict(result);
  if (!result.has_pose || !result.filter_updated) return;
  geometry_msgs::PoseWithCovarianceStamped pose;
  pose.header.stamp = ros::Time(result.stamp_s);
  pose.header.frame_id = config_.global_frame_id;
  pose.pose.pose = pose_message(result.T_map_base);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) {
      pose.pose.covariance[static_cast<std::size_t>(6 * kCovarianceRows[i] + kCovarianceRows[k])] =
          result.covariance(i, k);
    }
  }
  pose_pub_.publish(pose);
  const ros::WallTime now = ros::WallTime::now();
  if (cloud_pub_.getNumSubscribers() == 0 && (now - last_cloud_wall_).toSec() < 1.0) return;
  last_cloud_wall_ = now;
  const ParticleSet& particles = localizer_->particles();
  geometry_msgs::PoseArray cloud;
  cloud.header = pose.header;
  cloud.poses.resize(particles.size());
  for (std::size_t i = 0; i < particles.size(); ++i) cloud.poses[i] = pose_message(particles.pose(i));
  cloud_pub_.publish(cloud);
}

void LocalizerNodelet::publish_status(const LocalizerResult& result) {
  kinect_nav::LocalizationStatus status;
  status.header.stamp = ros::Time(std::max(0.0, result.stamp_s));
  status.header.frame_id = config_.global_frame_id;
  status.status = static_cast<std::uint8_t>(result.verdict);
  status.reason = result.reason;
  status.inlier_fraction = static_cast<float>(result.inlier_fraction);
  status.explained_rays = result.explained_rays;
  status.unexplained_rays = result.unexplained_rays;
  status.unknown_rays = result.unknown_rays;
  status.position_sd_m = static_cast<float>(result.position_sd_m);
  status.yaw_sd_rad = static_cast<float>(result.yaw_sd_rad);
  status.particles = result.particles;
  status.motion_epoch = inbox_->mapper_epoch();
  status_pub_.publish(status);
  diagnostics_->status(result);
  last_status_wall_ = ros::WallTime::now();
}

void LocalizerNodelet::log_verdict(const LocalizerResult& result) {
  if (result.verdict == last_verdict_) return;
  last_verdict_ = result.verdict;
  const std::string text = fmt::format("localizer: {}: {}.", verdict_name(result.verdict), result.reason);
  if (result.verdict == LocalizationVerdict::kLost) {
    NODELET_WARN("%s", text.c_str());
  } else {
    NODELET_INFO("%s", text.c_str());
  }
}

void LocalizerNodelet::remember_pose(double now_s, bool at_end) {
  const LocalizerResult& result = localizer_->result();
  if (saved_pose_file_.empty() || config_.save_pose_rate <= 0.0 || result.verdict != LocalizationVerdict::kOk)
    return;
  if (!at_end && now_s >= saved_s_ && now_s - saved_s_ < 1.0 / config_.save_pose_rate) return;
  const Pose2 T_step = T_map_base_saved_.inverse() * result.T_map_base;
  if (has_saved_ && std::hypot(T_step.x_m, T_step.y_m) < 0.05 && std::fabs(T_step.yaw_rad) < 0.05) return;
  saved_s_ = now_s;
  T_map_base_saved_ = result.T_map_base;
  has_saved_ = true;
  try {
    save_pose(saved_pose_file_, {checksum_, result.T_map_base, result.covariance});
  } catch (const std::exception& error) {
    NODELET_WARN("localizer: the pose cannot be saved: %s", error.what());
    saved_pose_file_.clear();  // once is enough
  }
}

}  // namespace knav

PLUGINLIB_EXPORT_CLASS(knav::LocalizerNodelet, nodelet::Nodelet)
