#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/camera_model.h"

namespace knav {

/// A Kinect v1's faults (design: 11-bit disparity in codes of 1/8 px, z = f b / d).
struct KinectConfig {
  double baseline_m = 0.075;
  double focal_px = 585.0;
  double min_range_m = 0.5;
  double saturation_m = 20.0;  ///< beyond this anything may come
  double max_range_m = 26.0;   ///< largest value given out
  bool quantize = true;
  double noise_codes = 0.52;  ///< sd of the quantised readings; 0 = none
  double offset_at_10m =
      0.10;                 ///< largest relative error at 10 m of the device's ring-shaped disparity offset
  double band_codes = 1.0;  ///< step between two vertical bands
  bool shadow = true;       ///< pixels the projector does not light
  double dropout_signal = 0.02;  ///< signal below which a pixel gives nothing; 0 = never

  /// ideal: exact depth; calibrated: what a calibration leaves; default: a device as bought; harsh: a bad
  /// one.
  static KinectConfig preset(const std::string& name);
  static const std::vector<std::string>& preset_names();
};

/// One image row of the true scene, before the sensor.
struct TrueRow {
  float* z_m = nullptr;     ///< along the optical axis; +Inf = nothing there
  float* signal = nullptr;  ///< albedo x cosine of incidence, before the fall with range
};

/// Turns true depth rows into what the sensor says. Deterministic by (seed, frame, row).
class KinectModel {
 public:
  KinectModel(const KinectConfig& config, const PinholeModel& camera, std::uint64_t seed,
              std::uint64_t device_seed);

  void start_frame(std::uint64_t frame_index);
  /// @param depth_mm one row of the output, 0 = invalid
  void sense_row(int row, const TrueRow& in, std::uint16_t* depth_mm);

  /// The device's disparity offset [px] (positive reads long), one value a pixel.
  const cv::Mat& disparity_offset_px() const { return offset_px_; }
  const KinectConfig& config() const { return config_; }

 private:
  void make_offset(std::uint64_t device_seed);
  void mark_lit(const float* codes);

  KinectConfig config_;
  PinholeModel camera_;
  std::uint64_t seed_, device_seed_;
  cv::Mat offset_px_, offset_codes_;
  std::vector<std::int16_t> noise_;  ///< sd 1
  float noise_sd_ = 0.0f;
  std::vector<float> band_position_, codes_;
  float bands_far_ = 0.0f, bands_per_inverse_m_ = 0.0f;  ///< steps across the image
  std::vector<std::int32_t> reading_;
  std::vector<float> lit_codes_;  ///< nearest disparity [codes] per projector column
  std::uint32_t noise_column_ = 0, noise_row_ = 0, texture_column_ = 0, texture_row_ = 0;
};

}  // namespace knav
