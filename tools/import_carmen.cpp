// import_carmen: a CARMEN log as a bag that replay and build_map read.
#include <fmt/format.h>
#include <nav_msgs/Odometry.h>
#include <rosbag/bag.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/file_io.h"
#include "core/progress.h"
#include "ros_common/conversions.h"
#include "ros_common/command_line.h"
#include "tools/carmen_log.h"

namespace knav {
namespace {

// SICK scanners send codes just below 81.92 m for "nothing came back": indoors a dark or shiny surface far more
// often than 80 m of open space, so it is unknown, not free.
constexpr float kNoReturn_m = 81.0f;

struct Options {
  std::string log, out;
  double fov_deg = 180.0;
  double max_range_m = 80.0;
};

geometry_msgs::TransformStamped transform_between(const std::string& parent, const std::string& child, ros::Time stamp,
                                                  const Pose2& T_parent_child) {
  geometry_msgs::TransformStamped transform;
  transform.header.stamp = stamp;
  transform.header.frame_id = parent;
  transform.child_frame_id = child;
  transform.transform = transform_message(T_parent_child);
  return transform;
}

sensor_msgs::LaserScan laser_message(const CarmenScan& scan, const Options& options) {
  const std::size_t count = scan.range_m.size();
  const double increment_rad = kPi / static_cast<double>(count - 1);
  const auto half = static_cast<std::size_t>(
      std::floor(std::min(options.fov_deg, 180.0) / 2.0 * kPi / 180.0 / increment_rad + 1e-9));
  const std::size_t middle = (count - 1) / 2;
  const std::size_t first = middle - std::min(half, middle), last = std::min(count - 1, middle + half);
  RangeScan out;
  out.stamp_s = scan.stamp_s;
  out.angle_min_rad = -kPi / 2.0 + static_cast<double>(first) * increment_rad;
  out.angle_increment_rad = increment_rad;
  out.range_min_m = 0.02;
  out.range_max_m = options.max_range_m;
  for (std::size_t i = first; i <= last; ++i) {
    const float range = scan.range_m[i];
    const bool measured = std::isfinite(range) && range > 0.02f && range < kNoReturn_m;
    out.range_m.push_back(!measured                                         ? std::numeric_limits<float>::quiet_NaN()
                          : range >= static_cast<float>(options.max_range_m) ? std::numeric_limits<float>::infinity()
                                                                             : range);
  }
  sensor_msgs::LaserScan message;
  scan_message(out, &message);
  message.header.frame_id = "laser";
  return message;
}

void write_odometry(rosbag::Bag& bag, double stamp_s, const Pose2& T_odom_base) {
  const ros::Time stamp(stamp_s);
  nav_msgs::Odometry odometry;
  odometry.header.stamp = stamp;
  odometry.header.frame_id = "odom";
  odometry.child_frame_id = "base_link";
  odometry.pose.pose = pose_message(T_odom_base);
  bag.write("/odom", stamp, odometry);
  tf2_msgs::TFMessage tf;
  tf.transforms.push_back(transform_between("odom", "base_link", stamp, T_odom_base));
  bag.write("/tf", stamp, tf);
}

void import(const Options& options) {
  CarmenLog log = read_carmen_log(options.log);
  std::stable_sort(log.scans.begin(), log.scans.end(),
                   [](const CarmenScan& a, const CarmenScan& b) { return a.stamp_s < b.stamp_s; });
  if (log.scans.front().stamp_s <= 0.0) throw UserError(options.log + ": a FLASER line has no valid time stamp.");
  // The log's odometry runs far from zero; a start at the origin keeps digits.
  const Pose2 T_start_odom = log.scans.front().T_odom_robot.inverse();
  Progress progress("import_carmen");
  write_file_atomically(options.out, [&](const std::string& beside) {
    rosbag::Bag bag(beside, rosbag::bagmode::Write);
    const ros::Time start(log.scans.front().stamp_s);
    tf2_msgs::TFMessage mount;
    mount.transforms.push_back(transform_between(
        "base_link", "laser", start, log.scans.front().T_odom_robot.inverse() * log.scans.front().T_odom_laser));
    bag.write("/tf_static", start, mount);
    for (const CarmenOdometry& odometry : log.odometry) {
      write_odometry(bag, odometry.stamp_s, T_start_odom * odometry.T_odom_robot);
    }
    double last_stamp_s = -1.0;
    for (std::size_t i = 0; i < log.scans.size(); ++i) {
      stop_if_interrupted();
      const CarmenScan& scan = log.scans[i];
      if (scan.stamp_s <= last_stamp_s) continue;
      last_stamp_s = scan.stamp_s;
      write_odometry(bag, scan.stamp_s, T_start_odom * scan.T_odom_robot);
      bag.write("/scan", ros::Time(scan.stamp_s), laser_message(scan, options));
      progress.update(static_cast<double>(i + 1) / static_cast<double>(log.scans.size()));
    }
    bag.close();
  });
  fmt::print("{}: {} scans, {:.0f} s, {} odometry lines\n", options.out, log.scans.size(),
             log.scans.back().stamp_s - log.scans.front().stamp_s, log.odometry.size());
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(
      "Turns a CARMEN log (FLASER and ODOM lines) into a bag: /scan (LaserScan, frame laser), /odom, /tf, /tf_static.\n"
      "Readings of 81 m and more are a SICK's 'nothing came back' and become NaN (unknown).");
  knav::Options options;
  app.add_option("LOG", options.log, "CARMEN log (.clf, .log)")->required();
  app.add_option("OUT", options.out, "bag to write")->required();
  app.add_option("--fov", options.fov_deg, "keep the middle DEG degrees; 57 imitates a Kinect")
      ->check(CLI::Range(1.0, 180.0))
      ->capture_default_str();
  app.add_option("--max-range", options.max_range_m, "readings from here on become +Inf, seen free to M metres")
      ->check(CLI::Range(0.5, 80.0))
      ->capture_default_str();
  return knav::run_command(app, argc, argv, [&] { knav::import(options); });
}
