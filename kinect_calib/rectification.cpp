#include "kinect_calib/rectification.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

namespace knav {
namespace {

bool same(const PinholeModel& a, const PinholeModel& b) {
  return a.width_px == b.width_px && a.height_px == b.height_px && a.fx_px == b.fx_px && a.fy_px == b.fy_px &&
         a.cx_px == b.cx_px && a.cy_px == b.cy_px;
}

cv::Matx33d matrix_of(const PinholeModel& model) {
  return {model.fx_px, 0.0, model.cx_px, 0.0, model.fy_px, model.cy_px, 0.0, 0.0, 1.0};
}

}  // namespace

bool RawCamera::distorted() const {
  return std::any_of(distortion.begin(), distortion.end(), [](double d) { return d != 0.0; });
}

bool RectificationTable::set_camera(const RawCamera& camera) {
  if (same(camera.raw, camera_.raw) && same(camera.rectified, camera_.rectified) &&
      camera.distortion == camera_.distortion) {
    return camera_.raw.valid();
  }
  camera_ = camera;
  source_.clear();
  identity_ = true;
  const std::size_t terms = camera.distortion.size();
  if (!camera.raw.valid() || !camera.rectified.valid()) return false;
  if (camera.distorted() && terms != 4 && terms != 5 && terms != 8) return false;
  if (!camera.distorted() && same(camera.raw, camera.rectified)) return true;
  identity_ = false;
  cv::Mat map_u, map_v;
  const std::vector<double> distortion = camera.distorted() ? camera.distortion : std::vector<double>(5, 0.0);
  cv::initUndistortRectifyMap(matrix_of(camera.raw), distortion, cv::Mat(), matrix_of(camera.rectified),
                              cv::Size(camera.rectified.width_px, camera.rectified.height_px), CV_32FC1,
                              map_u, map_v);
  source_.reserve(map_u.total());
  for (int v = 0; v < map_u.rows; ++v) {
    for (int u = 0; u < map_u.cols; ++u) {
      const float from_u = map_u.at<float>(v, u), from_v = map_v.at<float>(v, u);
      const bool inside = from_u >= -0.5f && from_v >= -0.5f &&
                          from_u < static_cast<float>(camera.raw.width_px) - 0.5f &&
                          from_v < static_cast<float>(camera.raw.height_px) - 0.5f;
      source_.push_back(inside ? static_cast<std::int32_t>(std::lround(from_v)) * camera.raw.width_px +
                                     static_cast<std::int32_t>(std::lround(from_u))
                               : -1);
    }
  }
  return true;
}

}  // namespace knav
