#include "tsdf_local_mapper/local_mapper_publisher.h"

#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/TransformStamped.h>

#include <boost/make_shared.hpp>

#include "ros_common/conversions.h"

namespace knav {

LocalMapperPublisher::LocalMapperPublisher(ros::NodeHandle& node, const LocalMapperRosConfig& config)
    : config_(config),
      scan_(node.advertise<sensor_msgs::LaserScan>("scan_360", 5)),
      map_(node.advertise<nav_msgs::OccupancyGrid>("local_map", 1)),
      motion_(node.advertise<kinect_nav::MotionEstimate>("motion_estimate", 20)),
      particles_(node.advertise<geometry_msgs::PoseArray>("local_particlecloud", 1)) {}

bool LocalMapperPublisher::due(double stamp_s, double rate_hz, double* last_s) {
  // A clock that jumped back makes it due as well.
  if (stamp_s >= *last_s && stamp_s - *last_s < 1.0 / rate_hz - 1e-3) return false;
  *last_s = stamp_s;
  return true;
}

void LocalMapperPublisher::publish(const LocalMapper& mapper) {
  const LocalMapperResult& result = mapper.result();
  const ros::Time stamp(result.stamp_s);
  publish_motion(result, stamp);
  if (config_.publish_tf) publish_transform(result, stamp);
  if (scan_.getNumSubscribers() > 0) {
    mapper.extract_scan_360(&scan_360_);
    auto message = boost::make_shared<sensor_msgs::LaserScan>();
    scan_message(scan_360_, message.get());
    message->header.stamp = stamp;
    message->header.frame_id = config_.base_frame;
    scan_.publish(message);
  }
  if (map_.getNumSubscribers() > 0 && due(result.stamp_s, config_.local_map_rate_hz, &last_map_s_)) {
    mapper.extract_local_map(&local_map_);
    auto message = boost::make_shared<nav_msgs::OccupancyGrid>();
    occupancy_message(local_map_, message.get());
    message->header.stamp = message->info.map_load_time = stamp;
    message->header.frame_id = config_.local_map_frame;
    map_.publish(message);
  }
  if (particles_.getNumSubscribers() > 0 &&
      due(result.stamp_s, config_.particlecloud_rate_hz, &last_particles_s_)) {
    publish_particles(mapper, stamp);
  }
  have_last_ = true;
  last_stamp_s_ = result.stamp_s;
  last_epoch_ = result.epoch;
  last_T_local_base_ = result.T_local_base;
}

void LocalMapperPublisher::publish_motion(const LocalMapperResult& result, const ros::Time& stamp) {
  auto message = boost::make_shared<kinect_nav::MotionEstimate>();
  message->header.stamp = stamp;
  message->header.frame_id = config_.local_map_frame;
  message->child_frame_id = config_.base_frame;
  message->epoch = result.epoch;
  message->pose.pose = pose_message(result.T_local_base);
  constexpr int kAxis[3] = {0, 1, 5};  // x, y and rotation about z of ROS's six
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      message->pose.covariance[static_cast<std::size_t>(6 * kAxis[i] + kAxis[j])] = result.covariance(i, j);
    }
  }
  const double dt_s = result.stamp_s - last_stamp_s_;
  if (have_last_ && result.epoch == last_epoch_ && dt_s > 0.0) {
    const Pose2 step = last_T_local_base_.inverse() * result.T_local_base;
    message->twist.twist.linear.x = step.x_m / dt_s;
    message->twist.twist.linear.y = step.y_m / dt_s;
    message->twist.twist.angular.z = step.yaw_rad / dt_s;
  }
  motion_.publish(message);
}

void LocalMapperPublisher::publish_transform(const LocalMapperResult& result, const ros::Time& stamp) {
  if (have_last_ && result.stamp_s == last_stamp_s_) return;  // never the same stamp twice
  geometry_msgs::TransformStamped message;
  message.header.stamp = stamp;
  message.header.frame_id = config_.odom_frame;
  message.child_frame_id = config_.local_map_frame;
  message.transform = transform_message(result.T_odom_base * result.T_local_base.inverse());
  broadcaster_.sendTransform(message);
}

void LocalMapperPublisher::publish_particles(const LocalMapper& mapper, const ros::Time& stamp) {
  auto message = boost::make_shared<geometry_msgs::PoseArray>();
  message->header.stamp = stamp;
  message->header.frame_id = config_.local_map_frame;
  const ParticleSet& particles = mapper.particles();
  message->poses.reserve(particles.size());
  for (std::size_t i = 0; i < particles.size(); ++i)
    message->poses.push_back(pose_message(particles.pose(i)));
  particles_.publish(message);
}

}  // namespace knav
