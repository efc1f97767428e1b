// calibrate_depth_live: takes the robot through the wall distances of a depth calibration, then calibrates.
#include <fmt/format.h>
#include <ros/ros.h>

#include "core/error.h"
#include "kinect_calib/depth_calibration_run.h"
#include "kinect_calib/live_calibration.h"
#include "ros_common/command_line.h"
#include "ros_common/parameters.h"

namespace knav {
namespace {

struct Options {
  DepthCalibrationOptions fit;
  LiveTopics topics;
  bool ask = false, resume = false, behind_is_free = false;
};

const char* const kHelp =
    R"(Place the robot 0.55 to 1 m from a light, matt, flat wall that fills the Kinect's view from there and from 4 m, with
4 m of free floor behind it: it drives backwards and sees nothing there. It turns square, stands, collects, turns by 10
degrees to both sides, backs off by about 10 %, and so on. Whatever is not as it should be stops it, and is said.
SESSION becomes a folder as calibrate_depth reads it (distances.csv, 16-bit PNG in mm, camera_info.yaml); every finished
distance is kept, and --resume goes on with it. At the end the calibration is fitted as calibrate_depth does.
Topic calibration_view (an image, for rviz or rqt_image_view) shows the IR image and a cross; the range finder's beam and the
marker on the wall belong on the cross. Without IR it shows how the depth departs from a plane. Topic calibration_status
(text) says what the robot does.
How far, how fast, how many frames: parameters of the node calibrate_depth_live (docs/parameters.md), such as _step:=0.08.)";

/// True once somebody has said that nothing is in the way.
bool behind_is_free(const Options& options, double last_distance_m, TerminalPrompt* prompt) {
  if (options.behind_is_free) return true;
  if (!TerminalPrompt::is_terminal())
    throw UserError(
        "the robot backs off blind: see that the way behind it is free, and say so with "
        "--yes-behind-is-free.");
  fmt::print(
      "The robot drives backwards until it is {:.1f} m from the wall, and sees nothing there. Is the way "
      "behind it "
      "free? Type yes: ",
      last_distance_m);
  std::fflush(stdout);
  while (true) {
    stop_if_interrupted();
    if (const auto line = prompt->poll_line()) return *line == "yes";
    ros::WallDuration(0.05).sleep();
  }
}

/// @return false after Ctrl-C
bool calibrate(Options options) {
  if (!ros::master::check()) throw UserError("no ROS master answers: start the robot first (robot.launch).");
  const auto config = read_parameters<GuidedCalibrationConfig>(ros::NodeHandle("~"));
  WallFolder folder(options.fit.input, options.resume);
  TerminalPrompt prompt;
  GuidedStart start;
  start.range_finder = !options.ask;
  start.range_offset_m = options.topics.range_offset_m;
  start.done_m = folder.distances_m();
  const ros::NodeHandle node;
  start.depth_topic = node.resolveName(options.topics.depth);
  start.odometry_topic = node.resolveName(options.topics.odometry);
  start.range_topic = node.resolveName(options.topics.range);
  start.behind_is_free = behind_is_free(options, config.last_distance_m, &prompt);
  try {
    const std::string device = options.fit.device.empty() ? "depth" : options.fit.device;
    if (!LiveCalibration(options.topics, device, config, start, &folder, &prompt).run()) {
      fmt::print(
          stderr,
          "\ncalibrate_depth_live: interrupted; the robot was told to stop. {} distances are in {}: go on "
          "with --resume.\n",
          folder.distances_m().size(), folder.path());
      return false;
    }
  } catch (const UserError& error) {
    throw UserError(fmt::format("{} The robot was told to stop. {} distances are in {}: go on with --resume.",
                                error.what(), folder.distances_m().size(), folder.path()));
  }
  run_depth_calibration(options.fit);
  return true;
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app("Guides the robot through a depth calibration before a wall, and calibrates.");
  knav::Options options;
  app.add_option("SESSION", options.fit.input, "folder to collect in")->required();
  knav::add_fit_options(&app, &options.fit);
  app.add_flag("--resume", options.resume, "go on with what SESSION holds");
  app.add_flag("--yes-behind-is-free", options.behind_is_free,
               "the way behind the robot is free; else a terminal is asked");
  app.add_flag("--ask", options.ask, "no range finder: ask for each distance in the terminal");
  app.add_option("--depth-topic", options.topics.depth, "depth images, as the sensor gives them")
      ->capture_default_str();
  app.add_option("--info-topic", options.topics.info, "their camera_info")->capture_default_str();
  app.add_option("--odom-topic", options.topics.odometry, "nav_msgs/Odometry")->capture_default_str();
  app.add_option("--cmd-topic", options.topics.command, "geometry_msgs/Twist, to the base")
      ->capture_default_str();
  app.add_option("--range-topic", options.topics.range, "sensor_msgs/Range of the range finder")
      ->capture_default_str();
  app.add_option("--range-offset", options.topics.range_offset_m,
                 "added to each range to get the camera's distance [m]")
      ->capture_default_str();
  app.add_option("--ir-topic", options.topics.infrared, "IR images, to aim by")->capture_default_str();
  app.add_option("--ir-info-topic", options.topics.infrared_info, "their camera_info")->capture_default_str();
  app.footer(knav::kHelp);
  ros::init(argc, argv, "calibrate_depth_live", ros::init_options::NoSigintHandler);
  bool finished = false;
  const int code = knav::run_command(app, argc, argv, [&] { finished = knav::calibrate(options); });
  return code != 0 || finished || app.count("--help") > 0 ? code : 130;
}
