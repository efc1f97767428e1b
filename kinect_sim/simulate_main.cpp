#include <fmt/format.h>
#include <rosbag/bag.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"
#include "kinect_sim/simulator_node_config.h"
#include "kinect_sim/tour_recorder.h"
#include "ros_common/command_line.h"

namespace {

constexpr char kHelp[] =
    "Drives a script through a simulated building and records what the robot's topics say: odom, tf, "
    "tf_static,\n"
    "ground_truth, mark_place and, if asked, camera/depth/image_raw, camera/depth/camera_info, lidar_scan, "
    "range.\n"
    "No ROS master is needed. The same world, script, options and seed give the same recording.\n"
    "World and script files: docs/simulator.md. --json: {duration_s, distance_m, depth_frames, marks, "
    "collisions,\n"
    "walker_contacts, odometry_error_m, odometry_error_deg}; the odometry's errors are those at the end.";

/// A preset named on the command line, if any.
void choose(const char* option, const std::string& given, const std::vector<std::string>& names,
            std::string* value) {
  if (given.empty()) return;
  if (std::find(names.begin(), names.end(), given) == names.end()) {
    throw knav::UserError(fmt::format("{}: '{}' must be one of {}.", option, given, fmt::join(names, " | ")));
  }
  *value = given;
}

double depth_seconds(const std::string& text) {
  if (text == "none") return 0.0;
  if (text == "all") return std::numeric_limits<double>::infinity();
  try {
    std::size_t used = 0;
    const double seconds = std::stod(text, &used);
    if (used == text.size() && seconds >= 0.0) return seconds;
  } catch (const std::exception&) {
  }
  throw knav::UserError("--depth: '" + text + "' must be none, all, standing or a number of seconds.");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(kHelp, "simulate");
  std::string world, script, record, json, truth, odometry, config_file, depth = "none", compression = "none";
  std::string sensor, odometry_preset;
  int seed = -1, device_seed = -1;
  knav::RecordingOptions options;
  app.add_option("WORLD", world, "World file (config/worlds/*.yaml)")->required();
  app.add_option("--script", script, "Tour script")->required();
  app.add_option("--record", record, "Bag to write");
  app.add_option("--truth", truth, "TUM file of the true poses to write");
  app.add_option("--odometry-trajectory", odometry, "TUM file of the odometry's poses to write");
  app.add_option("--config", config_file, "Configuration file; its section 'simulator' is used");
  app.add_option("--seed", seed, "Seed of all noise")->check(CLI::NonNegativeNumber);
  app.add_option("--device-seed", device_seed, "Which Kinect and which base")->check(CLI::NonNegativeNumber);
  app.add_option("--sensor", sensor, "ideal | calibrated | default | harsh");
  app.add_option("--odometry", odometry_preset, "perfect | default | bad");
  app.add_option("--depth", depth, "Raw depth to record: none, all, standing (while the robot stands still) or its first SECONDS "
                 "(18 MB a second)");
  app.add_option("--compression", compression, "none | lz4 | bz2")
      ->check(CLI::IsMember({"none", "lz4", "bz2"}));
  app.add_flag("--lidar", options.lidar, "Record lidar_scan too (180 deg, 361 rays, 10 Hz)");
  app.add_flag("--range", options.range,
               "Record range too: the true distance straight ahead, for calibration");
  app.add_option("--json", json, "Write figures as JSON (- for standard output)");
  return knav::run_command(app, argc, argv, [&] {
    options.depth_standing_only = depth == "standing";
    options.depth_s = depth_seconds(options.depth_standing_only ? "all" : depth);
    knav::SimulatorConfig config =
        knav::read_config_section<knav::SimulatorNodeConfig>(config_file, "simulator");
    if (seed >= 0) config.seed = seed;
    if (device_seed >= 0) config.device_seed = device_seed;
    choose("--sensor", sensor, knav::KinectConfig::preset_names(), &config.sensor);
    choose("--odometry", odometry_preset, knav::OdometryErrors::preset_names(), &config.odometry);
    const knav::TourScript tour = knav::load_tour(script);
    knav::Simulator simulator(knav::load_world(world), config);
    knav::TourResult result;
    if (record.empty()) {
      result = knav::run_tour(simulator, tour, options, nullptr);
    } else {
      knav::write_file_atomically(record, [&](const std::string& path) {
        rosbag::Bag bag(path, rosbag::bagmode::Write);
        if (compression == "lz4") bag.setCompression(rosbag::compression::LZ4);
        if (compression == "bz2") bag.setCompression(rosbag::compression::BZ2);
        result = knav::run_tour(simulator, tour, options, &bag);
        bag.close();
      });
    }
    if (!truth.empty()) knav::write_trajectory(truth, result.truth);
    if (!odometry.empty()) knav::write_trajectory(odometry, result.odometry);
    const knav::Pose2 true_motion = simulator.world().spawn.inverse() * simulator.T_world_base();
    const knav::Pose2 error = true_motion.inverse() * simulator.T_odom_base();
    nlohmann::json figures = {{"duration_s", result.duration_s},
                              {"distance_m", result.distance_m},
                              {"depth_frames", result.depth_frames},
                              {"marks", result.marks},
                              {"collisions", result.contacts.collisions},
                              {"walker_contacts", result.contacts.walker_contacts},
                              {"odometry_error_m", std::hypot(error.x_m, error.y_m)},
                              {"odometry_error_deg", error.yaw_rad * 180.0 / knav::kPi}};
    knav::write_json(json, figures.dump(2));
    if (json != "-") {
      fmt::print(
          "{:.1f} m in {:.1f} s, {} depth frames, {} marks, {} collisions; odometry ends {:.2f} m off.\n",
          result.distance_m, result.duration_s, result.depth_frames, result.marks.size(),
          result.contacts.collisions, std::hypot(error.x_m, error.y_m));
    }
  });
}
