#include "sensor_benchmark/sections.h"

#include "sensor_benchmark/device_calibration.h"

namespace knav {

const DepthCalibration& Devices::calibration(const std::string& preset, int device) {
  const auto key = std::make_pair(preset, device);
  auto found = calibrations_.find(key);
  if (found == calibrations_.end()) {
    options_.progress(0.0, "calibrating " + preset + " device " + std::to_string(device + 1));
    found = calibrations_
                .emplace(key, calibrate_device(KinectConfig::preset(preset), seed(device),
                                               device_seed(device), options_.quick ? 3 : 10))
                .first;
  }
  return found->second;
}

FrontEndConfig default_front_end(const SensorBenchmarkOptions& options) {
  return FrontEndConfig::from_file(options.config);
}

FrontEndConfig paper_front_end(const SensorBenchmarkOptions& options) {
  FrontEndConfig config = default_front_end(options);
  config.depth_correction.model = "paper";
  config.rolling_shutter.method = "paper";
  config.floor_removal.fit.method = "paper";
  config.depth_profile.method = "paper";
  return config;
}

}  // namespace knav
