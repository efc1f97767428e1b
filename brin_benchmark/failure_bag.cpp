#include "brin_benchmark/failure_bag.h"

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <nav_msgs/Path.h>
#include <rosbag/bag.h>
#include <std_msgs/String.h>
#include <tf2_msgs/TFMessage.h>

#include "core/file_io.h"
#include "ros_common/conversions.h"

namespace knav {
namespace {

constexpr double kKept_s = 30.0;

geometry_msgs::TransformStamped transform(const ros::Time& stamp, const char* parent, const char* child,
                                          const Pose2& T) {
  geometry_msgs::TransformStamped message;
  message.header.stamp = stamp;
  message.header.frame_id = parent;
  message.child_frame_id = child;
  message.transform = transform_message(T);
  return message;
}

nav_msgs::Odometry odometry(const ros::Time& stamp, const char* frame, const Pose2& T) {
  nav_msgs::Odometry message;
  message.header.stamp = stamp;
  message.header.frame_id = frame;
  message.child_frame_id = "base_link";
  message.pose.pose = pose_message(T);
  return message;
}

}  // namespace

void FailureBag::frame(double stamp_s, const Pose2& T_world_base, const Pose2& T_odom_base,
                       const NavigationStack& stack) {
  Moment moment;
  if (!moments_.empty() && moments_.front().stamp_s < stamp_s - kKept_s) {
    moment = std::move(moments_.front());  // its memory serves again
    moments_.pop_front();
  }
  moment.stamp_s = stamp_s;
  moment.T_world_base = T_world_base;
  moment.T_odom_base = T_odom_base;
  moment.located = stack.estimate(&moment.T_map_base);
  moment.profile = stack.profile();
  moment.scan = stack.scan();
  moment.plan = stack.planner().path();
  moment.doing = stack.planner().explanation();
  moments_.push_back(std::move(moment));
}

void FailureBag::failure(const std::string& leg, const std::string& reason) {
  write_file_atomically(path_stem_ + "_" + leg + ".bag", [&](const std::string& beside) {
    rosbag::Bag bag(beside, rosbag::bagmode::Write);
    bag.setCompression(rosbag::compression::LZ4);
    for (const Moment& m : moments_) {
      const ros::Time stamp(m.stamp_s);
      bag.write("ground_truth", stamp, odometry(stamp, "world", m.T_world_base));
      bag.write("odom", stamp, odometry(stamp, "odom", m.T_odom_base));
      tf2_msgs::TFMessage tf;
      tf.transforms.push_back(transform(stamp, "odom", "base_link", m.T_odom_base));
      if (m.located) {
        tf.transforms.push_back(transform(stamp, "map", "odom", m.T_map_base * m.T_odom_base.inverse()));
        geometry_msgs::PoseWithCovarianceStamped pose;
        pose.header.stamp = stamp;
        pose.header.frame_id = "map";
        pose.pose.pose = pose_message(m.T_map_base);
        bag.write("amcl_pose", stamp, pose);
      }
      bag.write("/tf", stamp, tf);
      kinect_nav::DepthProfile profile;
      profile_message(m.profile, &profile);
      profile.header.frame_id = "camera_depth_optical_frame";
      bag.write("depth_profile", stamp, profile);
      sensor_msgs::LaserScan scan;
      scan_message(m.scan, &scan);
      scan.header.frame_id = "base_link";
      bag.write("scan_360", stamp, scan);
      nav_msgs::Path path;
      path.header.stamp = stamp;
      path.header.frame_id = "map";
      for (const Point2& p : m.plan) {
        path.poses.emplace_back();
        path.poses.back().header = path.header;
        path.poses.back().pose = pose_message({p.x_m, p.y_m, 0.0});
      }
      bag.write("plan", stamp, path);
      std_msgs::String doing;
      doing.data = m.doing;
      bag.write("explanation", stamp, doing);
    }
    std_msgs::String why;
    why.data = reason;
    if (!moments_.empty()) bag.write("failure", ros::Time(moments_.back().stamp_s), why);
    bag.close();
  });
  moments_.clear();
}

}  // namespace knav
