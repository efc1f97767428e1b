#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "kinect_sim/block_matcher.h"
#include "kinect_sim/noise_field.h"

namespace knav {

/// A Kinect v1's faults (design: 11-bit disparity in codes of 1/8 px, z = f b / d).
struct KinectConfig {
  double baseline_m = 0.075;
  double focal_px = 585.0;
  double min_range_m = 0.5;
  double saturation_m = 20.0;  ///< beyond this anything may come
  double max_range_m = 26.0;   ///< largest value given out
  bool quantize = true;
  double noise_codes = 0.48;     ///< sd of the quantised readings of a surface seen square; 0 = none
  double slope_noise_px = 0.42;  ///< a slanted surface's noise: what it falls by in so many px, sd
  double offset_at_10m =
      0.10;                 ///< largest relative error at 10 m of the device's ring-shaped disparity offset
  double band_codes = 1.0;  ///< step between two vertical bands
  double bands = 15.5;      ///< steps across the image far off; of a device, within a tenth of this
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

/// Turns true depth rows into what the sensor says. Deterministic by (seed, frame, row). Rows are to come in
/// rising order: what a block matcher makes of a slope takes the row above.
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
  std::optional<BlockMatcher> matcher_;  ///< none of an ideal sensor
  NoiseField::Place grain_place_;        ///< of how much surfaces send back
  std::vector<float> band_position_;
  float bands_far_ = 0.0f, bands_per_inverse_m_ = 0.0f;  ///< steps across the image
  std::vector<float> codes_;                             ///< true disparities, after one more of column 0
  std::vector<float> seen_codes_, read_codes_;
  std::vector<std::int32_t> bands_, reading_mm_;
  std::vector<float> lit_codes_;  ///< nearest disparity [codes] per projector column
};

}  // namespace knav
