#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "kinect_calib/depth_calibration.h"
#include "kinect_calib/rectification.h"

namespace knav {

struct DepthCorrectionConfig {
  std::string calibration_file;
  std::string model = "default";
  double ratio_max = 1.6;

  template <class Visitor>
  void visit(Visitor& v) {
    v.text("calibration_file", calibration_file,
           "YAML written by calibrate_depth; empty: depth passes uncorrected.");
    v.choice("model", model, {"paper", "offset", "default"},
             "paper: quadratic in depth per tile. offset: offset in disparity per tile. default: offset and "
             "slope in disparity per tile.");
    v.number("ratio_max", ratio_max, 1.01, 4, "",
             "Guard: a depth is never changed by more than this factor.");
  }
  std::vector<std::string> validate() const { return {}; }
};

/// Lens rectification and depth correction (paper section III.B), one pass over the image: each pixel is
/// taken from its nearest raw pixel and given its tile's correction, interpolated between tile centres.
/// Corrected depth rises with raw depth everywhere and stays within ratio_max of it.
class DepthCorrector {
 public:
  /// Loads the calibration file. UserError if it is given and unusable.
  explicit DepthCorrector(const DepthCorrectionConfig& config);
  DepthCorrector(const DepthCorrectionConfig& config, const DepthCalibration& calibration);

  /// No calibration file: depths pass as the sensor gives them (the lens is still rectified).
  bool uncalibrated() const { return uncalibrated_; }

  /// @param depth    16UC1 mm (0 invalid) or 32FC1 m (NaN, Inf or <= 0 invalid), camera.raw's size
  /// @param corrected 32FC1 m, NaN invalid; allocated only when its size changes
  /// @return false if the image cannot be used; fault() says why in a sentence
  bool correct(const cv::Mat& depth, const RawCamera& camera, cv::Mat* corrected);
  /// For an image that has no lens distortion.
  bool correct(const cv::Mat& depth, const PinholeModel& camera, cv::Mat* corrected);
  const std::string& fault() const { return fault_; }

  /// The correction of one reading, for reports: the same function as the image's, at pixel (u, v) of the
  /// ideal image.
  double correct_depth_m(double u_px, double v_px, double depth_m) const;

 private:
  void set_calibration(const DepthCalibration& calibration);

  DepthCorrectionConfig config_;
  DepthCalibration calibration_;
  bool uncalibrated_ = true;
  RectificationTable table_;
  cv::Mat raw_metres_;
  std::vector<float> pixel_offset_;                 // offset and default: one per pixel
  std::vector<float> pixel_scale_;                  // default
  std::vector<float> pixel_a_, pixel_b_, pixel_c_;  // paper
  RawCamera undistorted_;
  std::string fault_;
};

}  // namespace knav
