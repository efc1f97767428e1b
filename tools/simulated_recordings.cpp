#include "tools/simulated_recordings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>

#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"
#include "kinect_sim/simulator.h"
#include "kinect_sim/tour_recorder.h"

namespace knav {
namespace {

namespace fs = std::filesystem;

/// Raised whenever simulator or front end come to give other profiles from the same parameters.
constexpr int kGeneration = 4;
constexpr double kOdometryRate_hz = 50.0;
constexpr std::uint64_t kFramesPerPerfectScan = 30;

/// Scanners at these heights together see what stands in the slice that the profile takes, up to 2 m, table tops of 3 cm included.
std::vector<double> slice_heights_m() {
  std::vector<double> heights;
  for (double height_m = 0.045; height_m < 1.0; height_m += 0.025) heights.push_back(height_m);
  for (double height_m = 1.1; height_m < 2.0; height_m += 0.2) heights.push_back(height_m);
  heights.push_back(1.98);
  return heights;
}

/// A world file and the files it starts from.
std::string world_text(const std::string& path) {
  std::string text = read_text_file(path);
  const YAML::Node world = load_yaml_file(path);
  if (world.IsMap() && world["base"]) {
    text += world_text((fs::path(path).parent_path() / world["base"].as<std::string>()).string());
  }
  return text;
}

SimulatorConfig simulator_config(const SimulatedDrive& drive) {
  SimulatorConfig config;
  config.sensor = drive.sensor;
  config.odometry = drive.odometry;
  config.seed = drive.seed;
  return config;
}

ProfileRecording simulate(const SimulatedDrive& drive) {
  const SimulatorConfig config = simulator_config(drive);
  Simulator simulator(load_world(drive.world_file), config);
  FrontEnd front_end(drive.front_end);
  PoseBuffer odometry;
  ProfileRecording recording;
  const Eigen::Isometry3d T_base_optical = simulator.T_base_optical();
  recording.T_base_camera = {config.camera_forward_m, 0.0, config.camera_yaw_deg * kPi / 180.0};
  cv::Mat depth;
  DepthProfile profile;
  RangeScan scan;
  std::vector<float> nearest;
  const std::vector<double> heights_m = slice_heights_m();
  TourObserver observer;
  observer.odometry = [&] { odometry.add(simulator.stamp_s(), simulator.T_odom_base()); };
  observer.frame = [&](const FrameRequest& request) {
    simulator.render(request, &depth);
    if (!front_end.process(depth, simulator.camera(), request.stamp_s, T_base_optical, odometry, &profile)) {
      throw UserError("the front end refuses a simulated frame: " + front_end.fault());
    }
    recording.add(profile);
    if (request.index % kFramesPerPerfectScan != 0) return true;
    nearest.clear();
    for (const double height_m : heights_m) {
      simulator.scan_perfect(request, height_m, &scan);
      if (nearest.empty()) nearest = scan.range_m;
      for (std::size_t i = 0; i < nearest.size(); ++i) nearest[i] = std::min(nearest[i], scan.range_m[i]);
    }
    recording.add_perfect_scan(recording.frames() - 1, nearest);
    return true;
  };
  TourResult result =
      run_tour(simulator, load_tour(drive.tour_file), kOdometryRate_hz, drive.limit_s, observer);
  recording.odometry = std::move(result.odometry);
  recording.truth = std::move(result.truth);
  return recording;
}

}  // namespace

std::string default_cache() {
  const char* home = std::getenv("HOME");
  return std::string(home ? home : ".") + "/.cache/kinect_nav";
}

SimulatedRecordings::SimulatedRecordings(std::string folder, bool fresh)
    : folder_(std::move(folder)), fresh_(fresh) {
  std::error_code error;
  fs::create_directories(folder_, error);
  if (error) throw UserError(fmt::format("--cache: cannot make {}: {}.", folder_, error.message()));
}

std::string SimulatedRecordings::path_of(const SimulatedDrive& drive) const {
  std::string decides =
      fmt::format("{} {} {} {} {} ", kGeneration, drive.sensor, drive.odometry, drive.seed, drive.limit_s);
  decides += world_text(drive.world_file) + read_text_file(drive.tour_file);
  ConfigDescriber describer;
  FrontEndConfig front_end = drive.front_end;
  front_end.visit(describer);
  for (const ParameterDescription& p : describer.parameters) decides += p.name + "=" + p.default_value + "\n";
  const std::string& calibration = drive.front_end.depth_correction.calibration_file;
  if (!calibration.empty()) decides += read_text_file(calibration);
  return (fs::path(folder_) / fmt::format("{}-{}-{}-{:016x}.profiles",
                                          fs::path(drive.world_file).stem().string(), drive.sensor,
                                          drive.seed, std::hash<std::string>{}(decides)))
      .string();
}

bool SimulatedRecordings::have(const SimulatedDrive& drive) const {
  return !fresh_ && fs::exists(path_of(drive));
}

ProfileRecording SimulatedRecordings::get(const SimulatedDrive& drive) {
  const std::string path = path_of(drive);
  if (have(drive)) return ProfileRecording::load(path);
  const ProfileRecording recording = simulate(drive);
  recording.save(path);
  return recording;
}

std::vector<double> SimulatedRecordings::marks_of(const SimulatedDrive& drive) {
  Simulator simulator(load_world(drive.world_file), simulator_config(drive));
  std::vector<double> stamps_s;
  TourObserver observer;
  observer.mark = [&](const std::string&) { stamps_s.push_back(simulator.stamp_s()); };
  run_tour(simulator, load_tour(drive.tour_file), kOdometryRate_hz, drive.limit_s, observer);
  return stamps_s;
}

}  // namespace knav
