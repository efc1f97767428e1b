#include "kinect_calib/calibration_view.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "kinect_calib/intrinsics_calibrator.h"

namespace knav {
namespace {

constexpr int kLine_px = 20, kMargin_px = 8;

void draw_cross(double u_px, double v_px, const cv::Scalar& colour, cv::Mat* picture) {
  // In sixteenths of a pixel. The middle stays open: the marker must be seen.
  const auto at = [](double u, double v) {
    return cv::Point(static_cast<int>(std::lround(16.0 * u)), static_cast<int>(std::lround(16.0 * v)));
  };
  constexpr double kGap_px = 6.0, kArm_px = 40.0;
  for (const double side : {-1.0, 1.0}) {
    cv::line(*picture, at(u_px + side * kGap_px, v_px), at(u_px + side * kArm_px, v_px), colour, 1,
             cv::LINE_AA, 4);
    cv::line(*picture, at(u_px, v_px + side * kGap_px), at(u_px, v_px + side * kArm_px), colour, 1,
             cv::LINE_AA, 4);
  }
  cv::circle(*picture, at(u_px, v_px), static_cast<int>(16 * kArm_px / 2), colour, 1, cv::LINE_AA, 4);
}

cv::Mat with_text(const cv::Mat& picture, const std::vector<std::string>& lines) {
  const int below_px = static_cast<int>(lines.size()) * kLine_px + kMargin_px;
  cv::Mat out(picture.rows + below_px, picture.cols, CV_8UC3, cv::Scalar(0, 0, 0));
  picture.copyTo(out.rowRange(0, picture.rows));
  for (std::size_t i = 0; i < lines.size(); ++i) {
    // A sentence too long for the image is set smaller.
    int baseline = 0;
    const int width_px = cv::getTextSize(lines[i], cv::FONT_HERSHEY_SIMPLEX, 0.45, 1, &baseline).width;
    const double room_px = picture.cols - 2 * kMargin_px;
    const double scale = 0.45 * std::min(1.0, room_px / std::max(1, width_px));
    cv::putText(out, lines[i],
                cv::Point(kMargin_px, picture.rows + static_cast<int>(i + 1) * kLine_px - kMargin_px / 2),
                cv::FONT_HERSHEY_SIMPLEX, scale, cv::Scalar(255, 255, 255), 1, cv::LINE_AA);
  }
  return out;
}

}  // namespace

cv::Mat infrared_view(const cv::Mat& infrared, double cross_u_px, double cross_v_px,
                      const std::vector<std::string>& lines) {
  cv::Mat picture;
  cv::cvtColor(grey_image(infrared), picture, cv::COLOR_GRAY2BGR);
  draw_cross(cross_u_px, cross_v_px, cv::Scalar(0, 255, 0), &picture);
  return with_text(picture, lines);
}

cv::Mat deviation_view(const cv::Mat& depth_m, const PinholeModel& camera, const WallPlane& plane,
                       const std::vector<std::string>& lines) {
  cv::Mat picture(depth_m.size(), CV_8UC3, cv::Scalar(0, 0, 0));
  for (int v = 0; v < depth_m.rows; ++v) {
    const float* row = depth_m.ptr<float>(v);
    cv::Vec3b* out = picture.ptr<cv::Vec3b>(v);
    const double y = (v - camera.cy_px) / camera.fy_px;
    for (int u = 0; u < depth_m.cols; ++u) {
      if (!(row[u] > 0.0f)) continue;
      const double x = (u - camera.cx_px) / camera.fx_px;
      const double codes = (1.0 / row[u] - plane.at(x, y)) / kInverseDepthPerCode;
      const auto fade =
          static_cast<unsigned char>(255.0 * (1.0 - std::min(1.0, std::abs(codes) / kViewFull_codes)));
      out[u] = codes > 0.0 ? cv::Vec3b(fade, fade, 255) : cv::Vec3b(255, fade, fade);
    }
  }
  draw_cross(camera.cx_px, camera.cy_px, cv::Scalar(0, 128, 0), &picture);
  return with_text(picture, lines);
}

}  // namespace knav
