#include <algorithm>
#include <cmath>

#include "core/quantile.h"
#include "kinect_calib/depth_corrector.h"
#include "sensor_benchmark/device_calibration.h"
#include "sensor_benchmark/sections.h"

namespace knav {
namespace {

constexpr int kTile_px = 16;
constexpr std::uint64_t kValidationSeed = 7919;  // none of the noise that the fit has seen

/// Mean relative error of corrected depth over the frame and in each tile.
class WallBias {
 public:
  WallBias(const PinholeModel& camera, double distance_m)
      : columns_(camera.width_px / kTile_px),
        distance_m_(distance_m),
        sum_(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(camera.height_px / kTile_px), 0.0),
        count_(sum_.size(), 0.0) {}

  void add(const cv::Mat& depth_m) {
    for (int v = 0; v < depth_m.rows; ++v) {
      for (int u = 0; u < depth_m.cols; ++u) {
        const float z = depth_m.at<float>(v, u);
        if (std::isnan(z)) continue;
        const auto tile = static_cast<std::size_t>((v / kTile_px) * columns_ + u / kTile_px);
        sum_[tile] += z / distance_m_ - 1.0;
        count_[tile] += 1.0;
      }
    }
  }
  double mean() const {
    double sum = 0.0, count = 0.0;
    for (std::size_t tile = 0; tile < sum_.size(); ++tile) {
      sum += sum_[tile];
      count += count_[tile];
    }
    return sum / count;
  }
  double tile_p95() const {
    std::vector<double> sizes;
    for (std::size_t tile = 0; tile < sum_.size(); ++tile) {
      if (count_[tile] > 0.0) sizes.push_back(std::abs(sum_[tile] / count_[tile]));
    }
    return quantile(sizes, 0.95);
  }

 private:
  int columns_;
  double distance_m_;
  std::vector<double> sum_, count_;
};

struct Worst {
  double mean = 0.0, tile_p95 = 0.0;  ///< over the devices
  void add(const WallBias& bias) {
    mean = std::max(mean, std::abs(bias.mean()));
    tile_p95 = std::max(tile_p95, bias.tile_p95());
  }
};

}  // namespace

nlohmann::json measure_calibration(const SensorBenchmarkOptions& options, Devices* devices,
                                   std::vector<Check>* checks) {
  std::vector<double> distances = {0.57, 0.75, 1.03, 1.45, 1.9,  2.6,  3.3,  3.9,  5.0, 6.0,
                                   7.0,  8.0,  9.0,  10.0, 12.0, 14.0, 16.0, 18.0, 20.0};
  if (options.quick) distances = {0.75, 1.9, 3.9, 7.0, 10.0, 15.0, 20.0};
  const int frames = options.quick ? 3 : 10;
  const std::vector<std::string> models = depth_model_names();
  std::vector<std::vector<Worst>> worst(models.size() + 1, std::vector<Worst>(distances.size()));
  for (int device = 0; device < devices->count(); ++device) {
    const DepthCalibration& calibration = devices->calibration("default", device);
    std::vector<DepthCorrector> correctors;
    for (const std::string& model : models) {
      DepthCorrectionConfig config = default_front_end(options).depth_correction;
      config.model = model;
      correctors.emplace_back(config, calibration);
    }
    WallView view(KinectConfig::preset("default"), devices->seed(device) + kValidationSeed,
                  devices->device_seed(device));
    cv::Mat raw_m, corrected_m;
    for (std::size_t i = 0; i < distances.size(); ++i) {
      std::vector<WallBias> bias(models.size() + 1, WallBias(view.camera(), distances[i]));
      for (int frame = 0; frame < frames; ++frame) {
        view.sense(distances[i], 0.0, 0.0, &raw_m);
        bias[0].add(raw_m);
        for (std::size_t k = 0; k < models.size(); ++k) {
          correctors[k].correct(raw_m, view.camera(), &corrected_m);
          bias[k + 1].add(corrected_m);
        }
      }
      for (std::size_t k = 0; k <= models.size(); ++k) worst[k][i].add(bias[k]);
      options.progress(
          (device + static_cast<double>(i) / static_cast<double>(distances.size())) / devices->count(),
          "calibration");
    }
  }
  nlohmann::json models_json;
  for (std::size_t k = 0; k <= models.size(); ++k) {
    nlohmann::json rows = nlohmann::json::array();
    for (std::size_t i = 0; i < distances.size(); ++i) {
      rows.push_back({{"distance_m", distances[i]},
                      {"worst_device_mean_bias_percent", 100 * worst[k][i].mean},
                      {"worst_device_tile_bias_p95_percent", 100 * worst[k][i].tile_p95}});
    }
    models_json[k == 0 ? "uncorrected" : models[k - 1]] = rows;
    if (k == 0 || models[k - 1] != default_front_end(options).depth_correction.model) continue;
    double mean_to_10 = 0.0, mean_to_20 = 0.0, tile_at_10 = 0.0, tile_at_20 = 0.0;
    for (std::size_t i = 0; i < distances.size(); ++i) {
      double* mean = distances[i] <= 10.0 ? &mean_to_10 : &mean_to_20;
      *mean = std::max(*mean, 100 * worst[k][i].mean);
      if (distances[i] == 10.0) tile_at_10 = 100 * worst[k][i].tile_p95;
      if (distances[i] == 20.0) tile_at_20 = 100 * worst[k][i].tile_p95;
    }
    checks->push_back({"calibration: mean bias to 10 m, worst device [%]", mean_to_10, 1.0});
    checks->push_back({"calibration: mean bias to 20 m, worst device [%]", mean_to_20, 3.0});
    checks->push_back({"calibration: p95 of tile bias at 10 m, worst device [%]", tile_at_10, 2.0});
    checks->push_back({"calibration: p95 of tile bias at 20 m, worst device [%]", tile_at_20, 6.0});
  }
  return {{"fitted_from_m", 0.5},
          {"fitted_to_m", 4.0},
          {"tile_px", kTile_px},
          {"frames_per_wall", frames},
          {"models", models_json}};
}

}  // namespace knav
