#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "kinect_calib/rectification.h"

namespace knav {

struct ChessboardConfig {
  int corners_across = 8, corners_down = 6;  ///< inner corners, where four squares meet
  double square_m = 0.04;
  int radial_terms = 2;        ///< k1, k2 or k1, k2, k3
  double least_change = 0.03;  ///< how far a view must lie from all before, in shares of the image
};

struct IntrinsicsResult {
  RawCamera camera;  ///< rectified: the largest image without empty pixels
  double fx_sd_px = 0.0, fy_sd_px = 0.0, cx_sd_px = 0.0, cy_sd_px = 0.0;
  double reprojection_rms_px = 0.0;
  int views = 0, dropped_views = 0;  ///< dropped: far worse than the others
  double covered = 0.0;              ///< share of a 10 x 8 raster of the image in which corners were seen
};

/// A camera's intrinsics from pictures of a flat chessboard (Zhang's method, by OpenCV).
class IntrinsicsCalibrator {
 public:
  enum class View { kTaken, kNoBoard, kTooSimilar };

  explicit IntrinsicsCalibrator(const ChessboardConfig& config) : config_(config) {}

  /// @param image 8 or 16 bit, one or three channels; an IR image's range of values is stretched
  /// UserError if the size changes.
  View add_view(const cv::Mat& image);
  int views() const { return static_cast<int>(corners_.size()); }
  /// Of the last view added, for pictures; empty if there was no board.
  const std::vector<cv::Point2f>& last_corners() const { return last_corners_; }

  /// UserError with fewer than five views, or if they do not determine a camera.
  IntrinsicsResult calibrate() const;

 private:
  bool similar_to_another(const std::vector<cv::Point2f>& corners) const;

  ChessboardConfig config_;
  cv::Size size_;
  std::vector<std::vector<cv::Point2f>> corners_;
  std::vector<cv::Point2f> last_corners_;
};

/// One channel of 8 bits; 16 bits are stretched from the 1st to the 99th percentile.
cv::Mat grey_image(const cv::Mat& image);

/// The text of a camera_info file as camera_info_manager reads it.
std::string camera_info_text(const RawCamera& camera, const std::string& camera_name);

}  // namespace knav
