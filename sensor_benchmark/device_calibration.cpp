#include "sensor_benchmark/device_calibration.h"

#include <cmath>
#include <limits>

#include "core/config.h"
#include "core/pose2.h"
#include "core/random.h"
#include "kinect_calib/depth_calibrator.h"
#include "kinect_calib/depth_corrector.h"
#include "kinect_sim/camera_mount.h"
#include "kinect_sim/solid.h"

namespace knav {
namespace {

constexpr double kNearestWall_m = 0.53, kFarthestWall_m = 4.0;
constexpr double kFinderSd_m = 0.002;
constexpr double kSquareSd_deg = 0.3;

}  // namespace

WallView::WallView(const KinectConfig& kinect, std::uint64_t seed, std::uint64_t device_seed)
    : camera_(kinect_camera()),
      kinect_(kinect, camera_, seed, device_seed),
      depth_mm_(camera_.height_px, camera_.width_px, CV_16UC1),
      z_m_(static_cast<std::size_t>(camera_.width_px)),
      signal_(z_m_.size()) {}

void WallView::sense(double distance_m, double tilt_x, double tilt_y, cv::Mat* depth_m) {
  depth_m->create(camera_.height_px, camera_.width_px, CV_32FC1);
  kinect_.start_frame(frame_);
  ++frame_;
  const double brightness = albedo(Material::kWall);
  for (int v = 0; v < camera_.height_px; ++v) {
    const double y = (v - camera_.cy_px) / camera_.fy_px;
    for (int u = 0; u < camera_.width_px; ++u) {
      const double x = (u - camera_.cx_px) / camera_.fx_px;
      const auto column = static_cast<std::size_t>(u);
      z_m_[column] = static_cast<float>(distance_m / (1.0 + tilt_x * x + tilt_y * y));
      signal_[column] = static_cast<float>(brightness / std::sqrt(1.0 + x * x + y * y));
    }
    kinect_.sense_row(v, {z_m_.data(), signal_.data()}, depth_mm_.ptr<std::uint16_t>(v));
  }
  for (int v = 0; v < camera_.height_px; ++v) {
    const auto* mm = depth_mm_.ptr<std::uint16_t>(v);
    float* metres = depth_m->ptr<float>(v);
    for (int u = 0; u < camera_.width_px; ++u) {
      metres[u] = mm[u] > 0 ? 0.001f * static_cast<float>(mm[u]) : std::numeric_limits<float>::quiet_NaN();
    }
  }
}

DepthCalibration calibrate_device(const KinectConfig& kinect, std::uint64_t seed, std::uint64_t device_seed,
                                  int frames) {
  WallView view(kinect, seed, device_seed);
  DepthCalibratorConfig config;
  config.range_finder_sd_m = kFinderSd_m;
  DepthCalibrator calibrator(config);
  RandomStream random(seed, random_stream::kSensorBenchmark, device_seed, 0);
  cv::Mat depth_m;
  for (double distance_m = kNearestWall_m; distance_m <= kFarthestWall_m;
       distance_m *= 1.0 + random.uniform(0.05, 0.15)) {
    const double tilt_x = std::tan(random.normal(0.0, kSquareSd_deg) * kPi / 180.0);
    const double tilt_y = std::tan(random.normal(0.0, kSquareSd_deg) * kPi / 180.0);
    const double read_m = distance_m + random.normal(0.0, kFinderSd_m);
    for (int i = 0; i < frames; ++i) {
      view.sense(distance_m, tilt_x, tilt_y, &depth_m);
      calibrator.add_frame(depth_m, view.camera(), read_m);
    }
  }
  DepthCalibration calibration = calibrator.fit();
  calibration.device = "simulated " + std::to_string(device_seed);
  return calibration;
}

std::vector<std::string> depth_model_names() {
  std::vector<std::string> names;
  for (const ParameterDescription& parameter : describe_config<DepthCorrectionConfig>()) {
    if (parameter.name != "model") continue;
    std::string rest = parameter.range;  // "a | b | c"
    while (!rest.empty()) {
      const std::size_t bar = rest.find(" | ");
      names.push_back(rest.substr(0, bar));
      rest = bar == std::string::npos ? "" : rest.substr(bar + 3);
    }
  }
  return names;
}

}  // namespace knav
