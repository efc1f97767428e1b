#include "kinect_calib/depth_calibration.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>

#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"

namespace knav {
namespace {

constexpr const char* kFormat = "kinect_nav_depth_calibration";
constexpr int kVersion = 2;

template <class T>
T get(const YAML::Node& file, const std::string& path, const char* key) {
  if (!file[key])
    throw UserError(fmt::format("{}: key '{}' is missing; write the file with calibrate_depth.", path, key));
  try {
    return file[key].as<T>();
  } catch (const YAML::Exception&) {
    throw UserError(fmt::format("{}: key '{}' has a value of the wrong kind.", path, key));
  }
}

}  // namespace

DepthCalibration DepthCalibration::identity(int width_px, int height_px, int tile_px) {
  DepthCalibration calibration;
  calibration.image_width_px = width_px;
  calibration.image_height_px = height_px;
  calibration.tile_px = tile_px;
  const std::size_t tiles = calibration.tile_count();
  calibration.linear_slope.assign(tiles, 0.0);
  calibration.linear_offset_per_m.assign(tiles, 0.0);
  calibration.inverse_depth_offset_per_m.assign(tiles, 0.0);
  calibration.quadratic_a_per_m.assign(tiles, 0.0);
  calibration.quadratic_b.assign(tiles, 1.0);
  calibration.quadratic_c_m.assign(tiles, 0.0);
  calibration.tile_state.assign(tiles, 0);
  calibration.tile_trained_max_m.assign(tiles, calibration.trained_max_m);
  return calibration;
}

std::vector<std::string> DepthCalibration::validate() const {
  std::vector<std::string> faults;
  if (image_width_px < 1 || image_height_px < 1 || image_width_px > 8192 || image_height_px > 8192 ||
      tile_px < 1) {
    faults.push_back("image size and 'tile_px' must be positive.");
    return faults;
  }
  const auto check = [&](const char* key, const std::vector<double>& values) {
    if (values.size() != tile_count()) {
      faults.push_back(
          fmt::format("'{}' has {} values; the image has {} tiles.", key, values.size(), tile_count()));
    }
    for (const double value : values) {
      if (!std::isfinite(value)) {
        faults.push_back(fmt::format("'{}' holds a value that is not a number.", key));
        break;
      }
    }
  };
  check("linear_slope", linear_slope);
  check("linear_offset_per_m", linear_offset_per_m);
  check("inverse_depth_offset_per_m", inverse_depth_offset_per_m);
  check("quadratic_a_per_m", quadratic_a_per_m);
  check("quadratic_b", quadratic_b);
  check("quadratic_c_m", quadratic_c_m);
  check("tile_trained_max_m", tile_trained_max_m);
  if (tile_state.size() != tile_count()) faults.push_back("'tile_state' does not have one value per tile.");
  if (std::any_of(linear_slope.begin(), linear_slope.end(), [](double s) { return !(std::abs(s) < 0.5); }))
    faults.push_back("'linear_slope' must lie in -0.5 ... 0.5.");
  if (!(std::abs(inverse_depth_scale) < 0.5))
    faults.push_back("'inverse_depth_scale' must lie in -0.5 ... 0.5.");
  if (!(trained_min_m > 0.0 && trained_max_m > trained_min_m)) {
    faults.push_back("'trained_min_m' and 'trained_max_m' must be positive and rising.");
  }
  return faults;
}

DepthCalibration load_depth_calibration(const std::string& path) {
  const YAML::Node file = load_yaml_file(path);
  if (!file.IsMap() || !file["format"] || file["format"].as<std::string>("") != kFormat) {
    throw UserError(fmt::format("{}: not a depth calibration (no 'format: {}').", path, kFormat));
  }
  const int version = get<int>(file, path, "version");
  if (version != 1 && version != kVersion) {
    throw UserError(fmt::format("{}: has version {}, this program reads 1 and {}; calibrate again.", path,
                                version, kVersion));
  }
  DepthCalibration calibration;
  calibration.device = get<std::string>(file, path, "device");
  calibration.image_width_px = get<int>(file, path, "image_width_px");
  calibration.image_height_px = get<int>(file, path, "image_height_px");
  calibration.tile_px = get<int>(file, path, "tile_px");
  calibration.trained_min_m = get<double>(file, path, "trained_min_m");
  calibration.trained_max_m = get<double>(file, path, "trained_max_m");
  calibration.inverse_depth_scale = get<double>(file, path, "inverse_depth_scale");
  calibration.inverse_depth_offset_per_m = get<std::vector<double>>(file, path, "inverse_depth_offset_per_m");
  calibration.quadratic_a_per_m = get<std::vector<double>>(file, path, "quadratic_a_per_m");
  calibration.quadratic_b = get<std::vector<double>>(file, path, "quadratic_b");
  calibration.quadratic_c_m = get<std::vector<double>>(file, path, "quadratic_c_m");
  calibration.tile_state = get<std::vector<int>>(file, path, "tile_state");
  if (version == 1) {
    calibration.linear_offset_per_m = calibration.inverse_depth_offset_per_m;
    calibration.linear_slope.assign(calibration.linear_offset_per_m.size(), calibration.inverse_depth_scale);
    calibration.tile_trained_max_m.assign(calibration.linear_offset_per_m.size(), calibration.trained_max_m);
  } else {
    calibration.linear_slope = get<std::vector<double>>(file, path, "linear_slope");
    calibration.linear_offset_per_m = get<std::vector<double>>(file, path, "linear_offset_per_m");
    calibration.tile_trained_max_m = get<std::vector<double>>(file, path, "tile_trained_max_m");
  }
  std::vector<std::string> faults = calibration.validate();
  for (std::string& fault : faults) fault = path + ": " + fault;
  if (!faults.empty()) throw_faults(faults);
  return calibration;
}

void save_depth_calibration(const std::string& path, const DepthCalibration& calibration) {
  std::string text = fmt::format(
      "# Depth correction of one sensor, written by calibrate_depth. Tiles are row-major.\n"
      "format: {}\nversion: {}\ndevice: \"{}\"\nimage_width_px: {}\nimage_height_px: {}\ntile_px: {}\n"
      "trained_min_m: {:.6g}\ntrained_max_m: {:.6g}\ninverse_depth_scale: {:.9g}\n",
      kFormat, kVersion, calibration.device, calibration.image_width_px, calibration.image_height_px,
      calibration.tile_px, calibration.trained_min_m, calibration.trained_max_m,
      calibration.inverse_depth_scale);
  const auto list = [&](const char* key, const std::vector<double>& values) {
    text += fmt::format("{}: [", key);
    for (std::size_t i = 0; i < values.size(); ++i)
      text += fmt::format("{}{:.7g}", i > 0 ? ", " : "", values[i]);
    text += "]\n";
  };
  list("linear_slope", calibration.linear_slope);
  list("linear_offset_per_m", calibration.linear_offset_per_m);
  list("inverse_depth_offset_per_m", calibration.inverse_depth_offset_per_m);
  list("quadratic_a_per_m", calibration.quadratic_a_per_m);
  list("quadratic_b", calibration.quadratic_b);
  list("quadratic_c_m", calibration.quadratic_c_m);
  list("tile_trained_max_m", calibration.tile_trained_max_m);
  text += fmt::format("tile_state: [{}]\n", fmt::join(calibration.tile_state, ", "));
  write_text_atomically(path, text);
}

}  // namespace knav
