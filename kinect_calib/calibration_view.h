#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/camera_model.h"
#include "kinect_calib/wall_plane.h"

namespace knav {

/// Pictures for whoever guides a calibration, 8 bits BGR, with lines of text below the image.

/// The IR image with a cross where the range finder's beam must meet the marker: at the principal point.
/// @param infrared one channel of 8 or 16 bits
cv::Mat infrared_view(const cv::Mat& infrared, double cross_u_px, double cross_v_px,
                      const std::vector<std::string>& lines);

/// How each pixel departs from the wall's plane: white on it, red nearer, blue farther, full at
/// kViewFull_codes; black where there is no depth.
/// @param depth_m 32FC1 m, NaN invalid, lens rectified
cv::Mat deviation_view(const cv::Mat& depth_m, const PinholeModel& camera, const WallPlane& plane,
                       const std::vector<std::string>& lines);
constexpr double kViewFull_codes = 6.0;

}  // namespace knav
