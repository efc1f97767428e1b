#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "depth_profile_nodelet/front_end.h"
#include "kinect_calib/depth_calibration.h"

namespace knav {

/// What sensor_benchmark measures and how long it may take.
struct SensorBenchmarkOptions {
  int devices = 5;
  int seed = 1;
  bool quick = false;
  std::string worlds;    ///< folder of demo_building.yaml and brin_building.yaml
  std::string config;    ///< configuration file whose front end is `default`; empty: the defaults
  std::string pictures;  ///< folder for pictures of frames; empty: none
  std::function<void(double, const std::string&)> progress = [](double, const std::string&) {};
};

/// One figure beside what was asked of it.
struct Check {
  std::string name;
  double value = 0.0, limit = 0.0;
  bool at_most = true;  ///< else at least
  bool holds() const { return at_most ? value <= limit : value >= limit; }
};

/// The devices of one run: their calibrations are made once and shared by the sections.
class Devices {
 public:
  explicit Devices(const SensorBenchmarkOptions& options) : options_(options) {}
  int count() const { return options_.devices; }
  std::uint64_t device_seed(int device) const { return 101u + static_cast<std::uint64_t>(device); }
  std::uint64_t seed(int device) const {
    return static_cast<std::uint64_t>(options_.seed) * 1000u + static_cast<std::uint64_t>(device);
  }
  /// @param preset of KinectConfig
  const DepthCalibration& calibration(const std::string& preset, int device);

 private:
  const SensorBenchmarkOptions& options_;
  std::map<std::pair<std::string, int>, DepthCalibration> calibrations_;
};

/// The front end that users get, and every stage as the paper has it. Both have the same calibration.
FrontEndConfig default_front_end(const SensorBenchmarkOptions& options);
FrontEndConfig paper_front_end(const SensorBenchmarkOptions& options);

/// A section: its figures as JSON (units in the keys), and what was asked of them appended to `checks`.
nlohmann::json measure_calibration(const SensorBenchmarkOptions& options, Devices* devices,
                                   std::vector<Check>* checks);
nlohmann::json measure_rolling_shutter(const SensorBenchmarkOptions& options, Devices* devices,
                                       std::vector<Check>* checks);
nlohmann::json measure_floor(const SensorBenchmarkOptions& options, Devices* devices,
                             std::vector<Check>* checks);
nlohmann::json measure_profile(const SensorBenchmarkOptions& options, Devices* devices,
                               std::vector<Check>* checks);
nlohmann::json measure_cost(const SensorBenchmarkOptions& options, Devices* devices,
                            std::vector<Check>* checks);

}  // namespace knav
