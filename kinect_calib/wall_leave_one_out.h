#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "kinect_calib/depth_calibrator.h"

namespace knav {

/// A Kinect's raw disparity d to inverse depth, 1 / z = dc0 + dc1 d [1/m], and its pinhole model.
struct DisparityCamera {
  double dc0_per_m = 0.0, dc1_per_m = 0.0;
  PinholeModel pinhole;

  /// @param disparity CV_16UC1, 2047 = invalid
  /// @return 32FC1 m, NaN invalid
  cv::Mat depth_m(const cv::Mat& disparity) const;
};

/// A published correction of raw disparity per pixel (Herrera, Kannala, Heikkila, TPAMI 2012):
/// d' = d + beta(u, v) exp(alpha0 - alpha1 d).
struct PixelDisparityModel {
  double alpha0 = 0.0, alpha1 = 0.0;
  cv::Mat beta;  ///< CV_32FC1

  /// Reads dc_alpha and dc_beta of an OpenCV FileStorage. UserError names the file and key.
  static PixelDisparityModel load(const std::string& path);
  /// 32FC1 m.
  cv::Mat depth_m(const cv::Mat& disparity, const DisparityCamera& camera) const;
};

/// How flat a wall is: the plane in inverse depth, and what is off it.
struct WallFlatness {
  double distance_m = 0.0;  ///< of the plane along the optical axis
  double tilt_x = 0.0, tilt_y = 0.0;
  double residual_rms_codes = 0.0;  ///< in disparity codes of camera.dc1 [raw units]
  double residual_rms_m = 0.0;      ///< along the optical axis
};
/// Robust: pixels beyond six standard deviations (found by the median) are left out.
WallFlatness fit_wall_plane(const cv::Mat& depth_m, const DisparityCamera& camera);

struct LeaveOneOutWall {
  WallFlatness raw, published;       ///< published: zero where there is no such model
  std::vector<WallFlatness> models;  ///< in the order asked for
};

/// For each wall: calibrates on all others, whose distances are those of their own planes, corrects the one
/// left out (bands stay in it), and measures it.
std::vector<LeaveOneOutWall> leave_one_out(const std::vector<cv::Mat>& disparities,
                                           const DisparityCamera& camera,
                                           const PixelDisparityModel* published,
                                           const DepthCalibratorConfig& config,
                                           const std::vector<std::string>& models);

}  // namespace knav
