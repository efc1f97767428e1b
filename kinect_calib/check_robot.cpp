// check_robot: sensor, TF and odometry before the first drive, live or from a bag.
#include <fmt/format.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <tf2/buffer_core.h>
#include <tf2_eigen/tf2_eigen.h>
#include <tf2_msgs/TFMessage.h>

#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/progress.h"
#include "kinect_calib/depth_corrector.h"
#include "kinect_calib/depth_messages.h"
#include "kinect_calib/robot_check.h"
#include "ros_common/bag_reader.h"
#include "ros_common/command_line.h"
#include "ros_common/conversions.h"

namespace knav {
namespace {

struct Options {
  std::string bag, json, calibration, base_frame = "base_link";
  std::string depth_topic = "camera/depth/image_raw", info_topic = "camera/depth/camera_info",
              odom_topic = "odom";
  double seconds = 40.0;
  RobotCheckConfig check;
};

const char* const kHelp =
    R"(Without BAG it listens to the running robot for --seconds. Meanwhile, in a corridor or a room with 1 to 4 m of floor
ahead: turn in place by 60 degrees left and back, right and back, then drive a metre straight on. Exit code 0 if all is
well, 1 if not.
The JSON holds passed and items, a list of name, status (ok, problem, untested), found, to_do.)";

/// Hands messages to the check, whether they come from a bag or a topic.
class Feeder {
 public:
  explicit Feeder(const Options& options)
      : options_(options), check_(options.check), tf_(ros::Duration(1e6)), corrector_(correction(options)) {}

  void info(const sensor_msgs::CameraInfo& message) {
    camera_ = raw_camera_from(message);
    check_.add_camera_info(camera_.rectified);
  }

  void image(const sensor_msgs::Image& message, double arrival_s) {
    const double stamp_s = message.header.stamp.toSec();
    frame_ = message.header.frame_id;
    newest_image_ = message.header.stamp;
    if (!check_.has_mount()) look_up_mount();
    std::string fault;
    if (!view_depth(message, &view_, &fault)) {
      check_.add_bad_frame(stamp_s, arrival_s, fault);
      return;
    }
    RawCamera camera = camera_;
    if (!camera.raw.valid() || camera.raw.width_px != view_.cols || camera.raw.height_px != view_.rows) {
      camera = RawCamera{};  // judged there; here it only has to let the depths through
      camera.raw = camera.rectified = {view_.cols,       view_.rows,       1.0 * view_.cols,
                                       1.0 * view_.cols, 0.5 * view_.cols, 0.5 * view_.rows};
    }
    if (corrector_.correct(view_, camera, &depth_m_)) {
      check_.add_frame(stamp_s, arrival_s, depth_m_);
    } else {
      check_.add_bad_frame(stamp_s, arrival_s, corrector_.fault());
    }
  }

  void odometry(const nav_msgs::Odometry& message, double arrival_s) {
    if (!message.header.frame_id.empty()) odom_frame_ = plain(message.header.frame_id);
    check_.add_odometry(message.header.stamp.toSec(), arrival_s, pose2_from(message.pose.pose));
  }

  void transforms(const tf2_msgs::TFMessage& message, bool fixed) {
    for (const auto& transform : message.transforms) tf_.setTransform(transform, "check_robot", fixed);
  }

  std::vector<CheckItem> checklist() {
    look_up_mount();
    std::string why;
    bool found = false;
    try {
      // Not the very newest image: its transform may be on its way.
      tf_.lookupTransform(odom_frame_, options_.base_frame,
                          newest_image_.isZero() ? ros::Time(0) : newest_image_ - ros::Duration(0.3));
      found = true;
    } catch (const tf2::TransformException& error) {
      why = fmt::format("TF does not join {} and {}: {}", odom_frame_, options_.base_frame, error.what());
    }
    check_.set_odometry_tf(found, why);
    return check_.checklist();
  }

 private:
  static DepthCorrectionConfig correction(const Options& options) {
    DepthCorrectionConfig config;
    config.calibration_file = options.calibration;
    return config;
  }
  static std::string plain(const std::string& frame) { return frame[0] == '/' ? frame.substr(1) : frame; }

  void look_up_mount() {
    try {
      check_.set_mount(tf2::transformToEigen(tf_.lookupTransform(
                           options_.base_frame, frame_.empty() ? "?" : plain(frame_), ros::Time(0))),
                       "");
    } catch (const tf2::TransformException& error) {
      check_.set_mount(std::nullopt, frame_.empty()
                                         ? "No image came to name the camera's frame."
                                         : fmt::format("TF does not join {} and {}: {}", options_.base_frame,
                                                       plain(frame_), error.what()));
    }
  }

  const Options& options_;
  RobotCheck check_;
  tf2::BufferCore tf_;
  DepthCorrector corrector_;
  RawCamera camera_;
  cv::Mat view_, depth_m_;
  std::string frame_, odom_frame_ = "odom";
  ros::Time newest_image_;
};

void read_bag(const Options& options, Feeder* feeder) {
  const BagReader bag(options.bag);
  Progress progress("reading");
  bag.for_each({options.depth_topic, options.info_topic, options.odom_topic, "tf", "tf_static"},
               [&](const rosbag::MessageInstance& message, double done) {
                 const double arrival_s = message.getTime().toSec();
                 if (const auto image = message.instantiate<sensor_msgs::Image>()) {
                   feeder->image(*image, arrival_s);
                 } else if (const auto info = message.instantiate<sensor_msgs::CameraInfo>()) {
                   feeder->info(*info);
                 } else if (const auto odometry = message.instantiate<nav_msgs::Odometry>()) {
                   feeder->odometry(*odometry, arrival_s);
                 } else if (const auto tf = message.instantiate<tf2_msgs::TFMessage>()) {
                   feeder->transforms(*tf, message.getTopic().find("static") != std::string::npos);
                 }
                 progress.update(done);
               });
}

void listen(const Options& options, Feeder* feeder) {
  if (!ros::master::check()) throw UserError("no ROS master answers: start the robot first, or name a bag.");
  ros::NodeHandle node;
  const auto now_s = [] { return ros::Time::now().toSec(); };
  const std::vector<ros::Subscriber> subscribers = {
      node.subscribe<sensor_msgs::Image>(
          options.depth_topic, 10, [&](const sensor_msgs::ImageConstPtr& m) { feeder->image(*m, now_s()); }),
      node.subscribe<sensor_msgs::CameraInfo>(
          options.info_topic, 10, [&](const sensor_msgs::CameraInfoConstPtr& m) { feeder->info(*m); }),
      node.subscribe<nav_msgs::Odometry>(
          options.odom_topic, 100,
          [&](const nav_msgs::OdometryConstPtr& m) { feeder->odometry(*m, now_s()); }),
      node.subscribe<tf2_msgs::TFMessage>(
          "/tf", 100, [&](const tf2_msgs::TFMessageConstPtr& m) { feeder->transforms(*m, false); }),
      node.subscribe<tf2_msgs::TFMessage>(
          "/tf_static", 100, [&](const tf2_msgs::TFMessageConstPtr& m) { feeder->transforms(*m, true); })};
  Progress progress(options.check.standing ? "listening" : "turn left and right, then drive on");
  const ros::WallTime start = ros::WallTime::now();
  for (double done = 0.0; done < 1.0 && ros::ok();) {
    stop_if_interrupted();
    ros::spinOnce();
    ros::WallDuration(0.005).sleep();
    done = (ros::WallTime::now() - start).toSec() / options.seconds;
    progress.update(std::min(done, 1.0));
  }
}

void report(const Options& options, const std::vector<CheckItem>& items) {
  const char* const kStatus[] = {"ok", "problem", "untested"};
  nlohmann::json json = {{"passed", RobotCheck::passed(items)}, {"items", nlohmann::json::array()}};
  for (const CheckItem& item : items) {
    const char* status = kStatus[static_cast<int>(item.status)];
    json["items"].push_back(
        {{"name", item.name}, {"status", status}, {"found", item.found}, {"to_do", item.to_do}});
    if (options.json == "-") continue;
    fmt::print("{:<9} {:<20} {}\n", status, item.name, item.found);
    if (!item.to_do.empty()) fmt::print("{:31}-> {}\n", "", item.to_do);
  }
  write_json(options.json, json.dump(2));
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app("Checks sensor, TF and odometry before the first drive.");
  knav::Options options;
  app.add_option("BAG", options.bag, "recording to check; none: the running robot");
  app.add_option("--seconds", options.seconds, "live: how long to listen")
      ->check(CLI::Range(1.0, 3600.0))
      ->capture_default_str();
  app.add_flag("--standing", options.check.standing, "the robot is not moved: leave out what needs motion");
  app.add_option("--calibration", options.calibration, "calibrate_depth's file for the sensor");
  app.add_option("--time-offset", options.check.time_offset_s,
                 "rolling_shutter/time_offset_s as configured [s]")
      ->capture_default_str();
  app.add_option("--depth-topic", options.depth_topic, "depth images")->capture_default_str();
  app.add_option("--info-topic", options.info_topic, "their camera_info")->capture_default_str();
  app.add_option("--odom-topic", options.odom_topic, "nav_msgs/Odometry")->capture_default_str();
  app.add_option("--base-frame", options.base_frame, "the robot's frame")->capture_default_str();
  app.add_option("--json", options.json, "write the checklist to this file; '-' for standard output");
  app.footer(knav::kHelp);
  ros::init(argc, argv, "check_robot", ros::init_options::AnonymousName | ros::init_options::NoSigintHandler);
  bool passed = false;
  const int code = knav::run_command(app, argc, argv, [&] {
    knav::Feeder feeder(options);
    options.bag.empty() ? knav::listen(options, &feeder) : knav::read_bag(options, &feeder);
    const auto items = feeder.checklist();
    knav::report(options, items);
    passed = knav::RobotCheck::passed(items);
  });
  // --help and faults have ended above with their own code.
  return code != 0 ? code : (app.count("--help") > 0 || passed ? 0 : 1);
}
