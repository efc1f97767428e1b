#include "kinect_calib/depth_corrector.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/multiversion.h"
#include "kinect_calib/disparity_fit.h"

namespace knav {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kLargest_m = 100.0f;  // more is no depth, whatever the sensor says

KNAV_MULTIVERSION
void metres_from_mm(const std::uint16_t* from, int count, float* to) {
  for (int i = 0; i < count; ++i) to[i] = from[i] != 0 ? 0.001f * static_cast<float>(from[i]) : kNaN;
}

KNAV_MULTIVERSION
void metres_from_metres(const float* from, int count, float* to) {
  for (int i = 0; i < count; ++i) to[i] = (from[i] > 0.0f) & (from[i] < kLargest_m) ? from[i] : kNaN;
}

KNAV_MULTIVERSION
void take(const float* from, const std::int32_t* source, int count, float* to) {
  for (int i = 0; i < count; ++i) {
    const std::int32_t s = source[i];
    const float value = from[s < 0 ? 0 : s];
    to[i] = s < 0 ? kNaN : value;
  }
}

struct Guard {
  float lowest, highest;
};

inline float by_offset(float z, float scale, float offset, Guard guard) {
  const float divisor = scale + offset * z;  // 1/z_true = scale / z + offset
  const float low = 1.0f / guard.highest, high = 1.0f / guard.lowest;
  const float guarded = divisor < low ? low : divisor > high ? high : divisor;
  return z / guarded;
}

inline float by_quadratic(float z, float a, float b, float c, Guard guard) {
  const float corrected = (a * z + b) * z + c;
  const float low = guard.lowest * z, high = guard.highest * z;
  return corrected < low ? low : corrected > high ? high : corrected;
}

KNAV_MULTIVERSION
void correct_offset(float* z_m, int count, float scale, const float* offset, Guard guard) {
  for (int i = 0; i < count; ++i) z_m[i] = by_offset(z_m[i], scale, offset[i], guard);
}

KNAV_MULTIVERSION
void correct_linear(float* z_m, int count, const float* scale, const float* offset, Guard guard) {
  for (int i = 0; i < count; ++i) z_m[i] = by_offset(z_m[i], scale[i], offset[i], guard);
}

KNAV_MULTIVERSION
void correct_quadratic(float* z_m, int count, const float* a, const float* b, const float* c, Guard guard) {
  for (int i = 0; i < count; ++i) z_m[i] = by_quadratic(z_m[i], a[i], b[i], c[i], guard);
}

TileGrid grid_of(const DepthCalibration& calibration) {
  TileGrid grid;
  grid.columns = calibration.columns();
  grid.rows = calibration.rows();
  grid.tile_px = calibration.tile_px;
  return grid;
}

std::vector<float> per_pixel(const DepthCalibration& calibration, const std::vector<double>& values) {
  const TileGrid grid = grid_of(calibration);
  std::vector<float> pixels;
  pixels.reserve(static_cast<std::size_t>(calibration.image_width_px * calibration.image_height_px));
  for (int v = 0; v < calibration.image_height_px; ++v) {
    for (int u = 0; u < calibration.image_width_px; ++u) {
      pixels.push_back(static_cast<float>(interpolate_tiles(grid, values, u, v)));
    }
  }
  return pixels;
}

}  // namespace

DepthCorrector::DepthCorrector(const DepthCorrectionConfig& config) : config_(config) {
  if (config.calibration_file.empty()) return;
  set_calibration(load_depth_calibration(config.calibration_file));
}

DepthCorrector::DepthCorrector(const DepthCorrectionConfig& config, const DepthCalibration& calibration)
    : config_(config) {
  set_calibration(calibration);
}

void DepthCorrector::set_calibration(const DepthCalibration& calibration) {
  const std::vector<std::string> faults = calibration.validate();
  if (!faults.empty()) throw UserError("depth calibration: " + faults.front());
  calibration_ = calibration;
  uncalibrated_ = false;
  if (config_.model == "paper") {
    pixel_a_ = per_pixel(calibration_, calibration_.quadratic_a_per_m);
    pixel_b_ = per_pixel(calibration_, calibration_.quadratic_b);
    pixel_c_ = per_pixel(calibration_, calibration_.quadratic_c_m);
  } else if (config_.model == "default") {
    pixel_offset_ = per_pixel(calibration_, calibration_.linear_offset_per_m);
    pixel_scale_ = per_pixel(calibration_, calibration_.linear_slope);
    for (float& scale : pixel_scale_) scale += 1.0f;
  } else {
    pixel_offset_ = per_pixel(calibration_, calibration_.inverse_depth_offset_per_m);
  }
}

bool DepthCorrector::correct(const cv::Mat& depth, const PinholeModel& camera, cv::Mat* corrected) {
  undistorted_.raw = undistorted_.rectified = camera;
  return correct(depth, undistorted_, corrected);
}

bool DepthCorrector::correct(const cv::Mat& depth, const RawCamera& camera, cv::Mat* corrected) {
  fault_.clear();
  if (depth.empty() || (depth.type() != CV_16UC1 && depth.type() != CV_32FC1)) {
    fault_ = "the depth image is neither 16UC1 (mm) nor 32FC1 (m).";
    return false;
  }
  if (depth.cols != camera.raw.width_px || depth.rows != camera.raw.height_px) {
    fault_ = fmt::format("the depth image is {} x {}, its camera_info says {} x {}.", depth.cols, depth.rows,
                         camera.raw.width_px, camera.raw.height_px);
    return false;
  }
  if (!table_.set_camera(camera)) {
    fault_ = "camera_info has no usable K, P or D (plumb_bob and rational_polynomial are known).";
    return false;
  }
  const int width = camera.rectified.width_px, height = camera.rectified.height_px;
  if (!uncalibrated_ && (width != calibration_.image_width_px || height != calibration_.image_height_px)) {
    fault_ = fmt::format("the calibration is for {} x {} pixels, the image has {} x {}.",
                         calibration_.image_width_px, calibration_.image_height_px, width, height);
    return false;
  }
  corrected->create(height, width, CV_32FC1);
  cv::Mat* metres = corrected;
  if (!table_.identity()) {
    raw_metres_.create(depth.rows, depth.cols, CV_32FC1);
    metres = &raw_metres_;
  }
  for (int v = 0; v < depth.rows; ++v) {
    if (depth.type() == CV_16UC1) {
      metres_from_mm(depth.ptr<std::uint16_t>(v), depth.cols, metres->ptr<float>(v));
    } else {
      metres_from_metres(depth.ptr<float>(v), depth.cols, metres->ptr<float>(v));
    }
  }
  const Guard guard = {static_cast<float>(1.0 / config_.ratio_max), static_cast<float>(config_.ratio_max)};
  for (int v = 0; v < height; ++v) {
    float* row = corrected->ptr<float>(v);
    const std::size_t first = static_cast<std::size_t>(v) * static_cast<std::size_t>(width);
    if (!table_.identity()) take(raw_metres_.ptr<float>(), table_.source().data() + first, width, row);
    if (uncalibrated_) continue;
    if (config_.model == "paper") {
      correct_quadratic(row, width, pixel_a_.data() + first, pixel_b_.data() + first, pixel_c_.data() + first,
                        guard);
    } else if (config_.model == "default") {
      correct_linear(row, width, pixel_scale_.data() + first, pixel_offset_.data() + first, guard);
    } else {
      correct_offset(row, width, static_cast<float>(1.0 + calibration_.inverse_depth_scale),
                     pixel_offset_.data() + first, guard);
    }
  }
  return true;
}

double DepthCorrector::correct_depth_m(double u_px, double v_px, double depth_m) const {
  if (uncalibrated_) return depth_m;
  const Guard guard = {static_cast<float>(1.0 / config_.ratio_max), static_cast<float>(config_.ratio_max)};
  const auto z = static_cast<float>(depth_m);
  const TileGrid grid = grid_of(calibration_);
  const auto at = [&](const std::vector<double>& values) {
    return static_cast<float>(interpolate_tiles(grid, values, u_px, v_px));
  };
  if (config_.model == "paper") {
    return by_quadratic(z, at(calibration_.quadratic_a_per_m), at(calibration_.quadratic_b),
                        at(calibration_.quadratic_c_m), guard);
  }
  if (config_.model == "default") {
    return by_offset(z, static_cast<float>(1.0f + at(calibration_.linear_slope)),
                     at(calibration_.linear_offset_per_m), guard);
  }
  return by_offset(z, static_cast<float>(1.0 + calibration_.inverse_depth_scale),
                   at(calibration_.inverse_depth_offset_per_m), guard);
}

}  // namespace knav
