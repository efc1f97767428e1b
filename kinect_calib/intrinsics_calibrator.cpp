#include "kinect_calib/intrinsics_calibrator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "core/error.h"

namespace knav {
namespace {

constexpr int kFewestViews = 5;

}  // namespace

cv::Mat grey_image(const cv::Mat& image) {
  cv::Mat grey = image;
  if (image.channels() == 3) cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  if (grey.channels() != 1) throw UserError("an image must have one or three channels.");
  if (grey.depth() == CV_8U) return grey;
  if (grey.depth() != CV_16U) throw UserError("an image must have 8 or 16 bits.");
  std::vector<std::uint16_t> values(grey.begin<std::uint16_t>(), grey.end<std::uint16_t>());
  const auto at = [&](double share) {
    const auto i =
        values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), i, values.end());
    return static_cast<double>(*i);
  };
  const double low = at(0.01), high = std::max(low + 1.0, at(0.99));
  cv::Mat stretched;
  grey.convertTo(stretched, CV_8U, 255.0 / (high - low), -low * 255.0 / (high - low));
  return stretched;
}

IntrinsicsCalibrator::View IntrinsicsCalibrator::add_view(const cv::Mat& image) {
  last_corners_.clear();
  if (size_.empty()) size_ = image.size();
  if (image.size() != size_) {
    throw UserError(fmt::format("an image of {} x {} pixels among images of {} x {}.", image.cols, image.rows,
                                size_.width, size_.height));
  }
  const cv::Mat grey = grey_image(image);
  std::vector<cv::Point2f> corners;
  const cv::Size board(config_.corners_across, config_.corners_down);
  if (!cv::findChessboardCornersSB(grey, board, corners, cv::CALIB_CB_NORMALIZE_IMAGE)) {
    return View::kNoBoard;
  }
  last_corners_ = corners;
  if (similar_to_another(corners)) return View::kTooSimilar;
  corners_.push_back(corners);
  return View::kTaken;
}

/// By where the board's four outer corners are.
bool IntrinsicsCalibrator::similar_to_another(const std::vector<cv::Point2f>& corners) const {
  const auto across = static_cast<std::size_t>(config_.corners_across);
  const std::size_t outer[] = {0, across - 1, corners.size() - across, corners.size() - 1};
  const double far = config_.least_change * size_.width;
  return std::any_of(corners_.begin(), corners_.end(), [&](const std::vector<cv::Point2f>& other) {
    return std::all_of(std::begin(outer), std::end(outer),
                       [&](std::size_t i) { return cv::norm(corners[i] - other[i]) < far; });
  });
}

IntrinsicsResult IntrinsicsCalibrator::calibrate() const {
  if (views() < kFewestViews) {
    throw UserError(
        fmt::format("{} different views of the board: at least {} are needed, better 20, with the board "
                    "tilted and in all "
                    "corners of the image.",
                    views(), kFewestViews));
  }
  std::vector<cv::Point3f> board;
  for (int r = 0; r < config_.corners_down; ++r) {
    for (int c = 0; c < config_.corners_across; ++c) {
      board.emplace_back(static_cast<float>(c * config_.square_m), static_cast<float>(r * config_.square_m),
                         0.0f);
    }
  }
  IntrinsicsResult result;
  std::vector<std::vector<cv::Point2f>> used = corners_;
  const int flags = config_.radial_terms < 3 ? cv::CALIB_FIX_K3 : 0;
  cv::Mat K, D, sds, errors;
  try {
    for (int round = 0; round < 2; ++round) {
      const std::vector<std::vector<cv::Point3f>> boards(used.size(), board);
      cv::Mat poses, turns, extrinsic_sds;
      K = cv::Mat();
      D = cv::Mat();
      result.reprojection_rms_px =
          cv::calibrateCamera(boards, used, size_, K, D, turns, poses, sds, extrinsic_sds, errors, flags);
      if (round == 1) break;
      // A board that moved, or of which a corner was found in the wrong place.
      std::vector<double> sorted(errors.begin<double>(), errors.end<double>());
      std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2),
                       sorted.end());
      const double most = 3.0 * sorted[sorted.size() / 2];
      std::vector<std::vector<cv::Point2f>> kept;
      for (std::size_t i = 0; i < used.size(); ++i) {
        if (errors.at<double>(static_cast<int>(i)) <= most) kept.push_back(used[i]);
      }
      if (kept.size() == used.size() || kept.size() < static_cast<std::size_t>(kFewestViews)) break;
      used = kept;
    }
  } catch (const cv::Exception& error) {
    throw UserError("the views do not determine a camera: " + error.err);
  }
  result.views = static_cast<int>(used.size());
  result.dropped_views = views() - result.views;
  const auto k = [&](int r, int c) { return K.at<double>(r, c); };
  result.camera.raw = {size_.width, size_.height, k(0, 0), k(1, 1), k(0, 2), k(1, 2)};
  if (!(k(0, 0) > 0.0 && k(0, 0) < 20.0 * size_.width && k(0, 2) > 0.0 && k(0, 2) < size_.width)) {
    throw UserError(
        "the views do not determine a camera: tilt the board this way and that, up to 45 degrees.");
  }
  for (int i = 0; i < 5; ++i) result.camera.distortion.push_back(D.at<double>(i));
  const cv::Mat P = cv::getOptimalNewCameraMatrix(K, D, size_, 0.0);
  result.camera.rectified = {size_.width,        size_.height,       P.at<double>(0, 0),
                             P.at<double>(1, 1), P.at<double>(0, 2), P.at<double>(1, 2)};
  result.fx_sd_px = sds.at<double>(0);
  result.fy_sd_px = sds.at<double>(1);
  result.cx_sd_px = sds.at<double>(2);
  result.cy_sd_px = sds.at<double>(3);
  std::set<std::pair<int, int>> seen;
  for (const auto& view : used) {
    for (const cv::Point2f& corner : view) {
      seen.emplace(static_cast<int>(corner.x * 10.0f / static_cast<float>(size_.width)),
                   static_cast<int>(corner.y * 8.0f / static_cast<float>(size_.height)));
    }
  }
  result.covered = static_cast<double>(seen.size()) / 80.0;
  return result;
}

std::string camera_info_text(const RawCamera& camera, const std::string& camera_name) {
  const PinholeModel &k = camera.raw, &p = camera.rectified;
  return fmt::format(
      "image_width: {}\nimage_height: {}\ncamera_name: {}\n"
      "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [{:.8g}, 0, {:.8g}, 0, {:.8g}, {:.8g}, 0, 0, 1]\n"
      "distortion_model: plumb_bob\n"
      "distortion_coefficients:\n  rows: 1\n  cols: {}\n  data: [{:.8g}]\n"
      "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
      "projection_matrix:\n  rows: 3\n  cols: 4\n"
      "  data: [{:.8g}, 0, {:.8g}, 0, 0, {:.8g}, {:.8g}, 0, 0, 0, 1, 0]\n",
      k.width_px, k.height_px, camera_name, k.fx_px, k.cx_px, k.fy_px, k.cy_px, camera.distortion.size(),
      fmt::join(camera.distortion, ", "), p.fx_px, p.cx_px, p.fy_px, p.cy_px);
}

}  // namespace knav
