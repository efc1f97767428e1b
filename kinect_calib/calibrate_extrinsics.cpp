// calibrate_extrinsics: a short drive with depth and odometry -> where the camera sits, and odometry's time.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "core/file_io.h"
#include "kinect_calib/extrinsics_calibrator.h"
#include "kinect_calib/robot_bag.h"
#include "ros_common/command_line.h"

namespace knav {
namespace {

struct Options {
  std::string bag, out, calibration, json;
  RobotTopics topics;
  ExtrinsicsConfig config;
  bool floor_only = false;
};

constexpr double kDegree = kPi / 180.0;

const char* const kHelp =
    R"(BAG holds depth images, their camera_info and odometry. The drive, half a minute: with 1 to 4 m of bare floor ahead and
walls within 5 m on both sides (a corridor with some furniture is best), turn in place from standstill to standstill
at least four times by 60 degrees or more, to both sides, briskly; drive 2 m straight on, twice. Calibrate the sensor's
depth first: standard errors know nothing of what the sensor itself gets wrong.
The JSON (and --out, the same as YAML for roslaunch) holds height_m, pitch_deg, roll_deg, yaw_deg, forward_m, left_m,
time_offset_s (added to a depth stamp gives odometry's time), odometry_turn_scale and odometry_distance_scale (true /
odometry's), each with its standard error in _sd; frames, aligned_frames and floor_frames (counts);
static_transform_args.)";

nlohmann::json as_json(const ExtrinsicsResult& r, bool floor_only, std::string* args) {
  nlohmann::json json;
  const auto put = [&json](const std::string& name, const std::string& unit, const Estimate& e,
                           double scale) {
    json[name + unit] = e.value * scale;
    json[name + "_sd" + unit] = e.sd * scale;
  };
  put("height", "_m", r.floor.height_m, 1.0);
  put("pitch", "_deg", r.floor.pitch_rad, 1.0 / kDegree);
  put("roll", "_deg", r.floor.roll_rad, 1.0 / kDegree);
  json["frames"] = r.floor.frames;
  json["floor_frames"] = r.floor.frames_with_floor;
  if (floor_only) return json;
  put("yaw", "_deg", r.motion.yaw_rad, 1.0 / kDegree);
  put("forward", "_m", r.motion.forward_m, 1.0);
  put("left", "_m", r.motion.left_m, 1.0);
  put("time_offset", "_s", r.motion.time_offset_s, 1.0);
  put("odometry_turn_scale", "", r.motion.turn_scale, 1.0);
  put("odometry_distance_scale", "", r.motion.distance_scale, 1.0);
  json["aligned_frames"] = r.aligned_frames;
  *args = fmt::format("{:.4f} {:.4f} {:.4f} {:.5f} {:.5f} {:.5f} base_link camera_link",
                      r.motion.forward_m.value, r.motion.left_m.value, r.floor.height_m.value,
                      r.motion.yaw_rad.value, r.floor.pitch_rad.value, r.floor.roll_rad.value);
  json["static_transform_args"] = *args;
  return json;
}

void print(const ExtrinsicsResult& r, bool floor_only, const std::string& args) {
  const auto line = [](const char* name, const Estimate& e, double scale, const char* unit) {
    fmt::print("  {:<24} {:9.4f} +- {:.4f} {}\n", name, e.value * scale, e.sd * scale, unit);
  };
  fmt::print("Camera (floor in {} of {} frames):\n", r.floor.frames_with_floor, r.floor.frames);
  line("height", r.floor.height_m, 1.0, "m");
  line("pitch, down", r.floor.pitch_rad, 1.0 / kDegree, "deg");
  line("roll", r.floor.roll_rad, 1.0 / kDegree, "deg");
  if (floor_only) {
    fmt::print("\nFor robot.launch:\n  camera_z:={:.4f} camera_pitch:={:.5f} camera_roll:={:.5f}\n",
               r.floor.height_m.value, r.floor.pitch_rad.value, r.floor.roll_rad.value);
    return;
  }
  line("yaw, left", r.motion.yaw_rad, 1.0 / kDegree, "deg");
  line("forward", r.motion.forward_m, 1.0, "m");
  line("left", r.motion.left_m, 1.0, "m");
  fmt::print("Odometry ({} of {} frames aligned):\n", r.aligned_frames, r.frames);
  line("time offset", r.motion.time_offset_s, 1.0, "s");
  line("true turn / odometry's", r.motion.turn_scale, 1.0, "");
  line("true way / odometry's", r.motion.distance_scale, 1.0, "");
  fmt::print(
      "\nFor robot.launch:\n  camera_x:={:.4f} camera_y:={:.4f} camera_z:={:.4f} camera_yaw:={:.5f} "
      "camera_pitch:={:.5f} "
      "camera_roll:={:.5f}\nFor a launch file of your own, static_transform_publisher:\n  {}\n"
      "For the configuration file:\n  rolling_shutter: {{time_offset_s: {:.4f}}}\n",
      r.motion.forward_m.value, r.motion.left_m.value, r.floor.height_m.value, r.motion.yaw_rad.value,
      r.floor.pitch_rad.value, r.floor.roll_rad.value, args, r.motion.time_offset_s.value);
}

void calibrate(const Options& options) {
  if (options.calibration.empty()) {
    fmt::print(
        stderr,
        "calibrate_extrinsics: without --calibration depths are taken as they are; those of an uncalibrated "
        "Kinect may turn the yaw by 2 degrees.\n");
  }
  ExtrinsicsCalibrator calibrator(options.config);
  RobotBag bag(options.bag, options.topics, options.calibration);
  int frame = 0;
  bag.read("floor", {[&](const cv::Mat& depth, const PinholeModel& camera, double stamp_s) {
                       if (frame++ % 3 == 0) calibrator.add_floor_frame(depth, camera, stamp_s);
                     },
                     [&](double stamp_s, const Pose2& pose) { calibrator.add_odometry(stamp_s, pose); }});
  ExtrinsicsResult result;
  result.floor = calibrator.floor();
  if (!options.floor_only) {
    const FloorMount mount = result.floor.mount();
    bag.read("motion", {[&](const cv::Mat& depth, const PinholeModel& camera, double stamp_s) {
                          calibrator.add_motion_frame(depth, camera, mount, stamp_s);
                        },
                        {}});
    result = calibrator.result();
  }
  std::string args;
  const nlohmann::json json = as_json(result, options.floor_only, &args);
  if (!options.out.empty()) {
    std::string text = "# Written by calibrate_extrinsics from " + options.bag + "\n";
    for (const auto& [key, value] : json.items()) text += fmt::format("{}: {}\n", key, value.dump());
    write_text_atomically(options.out, text);
  }
  write_json(options.json, json.dump(2));
  if (options.json != "-") print(result, options.floor_only, args);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app("Finds where the camera sits on the robot, and odometry's time offset, from a short drive.");
  knav::Options options;
  app.add_option("BAG", options.bag, "recording of the drive")->required();
  app.add_option("--out", options.out, "write the figures to this file (YAML)");
  app.add_option("--calibration", options.calibration, "calibrate_depth's file for the sensor");
  app.add_flag("--floor-only", options.floor_only, "height, pitch and roll alone; the robot may stand still");
  app.add_option("--depth-topic", options.topics.depth, "depth images")->capture_default_str();
  app.add_option("--info-topic", options.topics.camera_info, "their camera_info")->capture_default_str();
  app.add_option("--odom-topic", options.topics.odometry, "nav_msgs/Odometry")->capture_default_str();
  app.add_option("--readout", options.config.timing.readout_s, "first to last row of an image [s]")
      ->check(CLI::Range(0.0, 0.1))
      ->capture_default_str();
  app.add_option("--stamp-row", options.config.timing.stamp_row_fraction,
                 "which row the stamp means: 0 the first, 1 the last")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app.add_option("--seed", options.config.floor.seed, "of the floor's random samples")->capture_default_str();
  app.add_option("--json", options.json, "write the figures to this file; '-' for standard output");
  app.footer(knav::kHelp);
  return knav::run_command(app, argc, argv, [&] { knav::calibrate(options); });
}
