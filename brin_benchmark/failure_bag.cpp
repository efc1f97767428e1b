#include "brin_benchmark/failure_bag.h"

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <nav_msgs/OccupancyGrid.h>
#include <nav_msgs/Path.h>
#include <rosbag/bag.h>
#include <std_msgs/String.h>
#include <tf2_msgs/TFMessage.h>

#include "core/file_io.h"
#include "ros_common/conversions.h"

namespace knav {
namespace {

constexpr double kKept_s = 30.0;
constexpr double kMapHalf_m = 8.0;

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

/// The combined map round a place: 100 occupied or keepout, 0 free, -1 unknown.
nav_msgs::OccupancyGrid map_round(const MapLayer& layer, const Pose2& T_map_base) {
  const GridGeometry& g = layer.geometry;
  const int half = static_cast<int>(kMapHalf_m / g.resolution_m), side = 2 * half + 1;
  const int cx = g.cell_x(T_map_base.x_m), cy = g.cell_y(T_map_base.y_m);
  nav_msgs::OccupancyGrid grid;
  grid.header.frame_id = "map";
  grid.info.resolution = static_cast<float>(g.resolution_m);
  grid.info.width = grid.info.height = static_cast<unsigned>(side);
  grid.info.origin = pose_message({g.center_x_m(cx - half) - 0.5 * g.resolution_m, g.center_y_m(cy - half) - 0.5 * g.resolution_m, 0.0});
  for (int iy = cy - half; iy <= cy + half; ++iy) {
    for (int ix = cx - half; ix <= cx + half; ++ix) {
      const CellState state = layer.at(ix, iy);
      grid.data.push_back(static_cast<signed char>(state == CellState::kFree ? 0 : state == CellState::kUnknown ? -1 : 100));
    }
  }
  return grid;
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
  stack_ = &stack;
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
    if (!moments_.empty()) {
      const Moment& last = moments_.back();
      bag.write("failure", ros::Time(last.stamp_s), why);
      if (last.located && !stack_->planner().map().empty()) {
        nav_msgs::OccupancyGrid map = map_round(stack_->planner().map().combined(), last.T_map_base);
        map.header.stamp = ros::Time(last.stamp_s);
        bag.write("combined_map", map.header.stamp, map);
      }
    }
    bag.close();
  });
  moments_.clear();
}

}  // namespace knav
