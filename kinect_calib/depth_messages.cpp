#include "kinect_calib/depth_messages.h"

#include <fmt/format.h>
#include <sensor_msgs/distortion_models.h>
#include <sensor_msgs/image_encodings.h>

#include "ros_common/conversions.h"

namespace knav {

bool view_depth(const sensor_msgs::Image& message, cv::Mat* view, std::string* fault) {
  namespace encodings = sensor_msgs::image_encodings;
  const bool millimetres = message.encoding == encodings::TYPE_16UC1 || message.encoding == encodings::MONO16;
  if (!millimetres && message.encoding != encodings::TYPE_32FC1) {
    *fault = fmt::format("the image has encoding '{}'; depth is 16UC1 (mm) or 32FC1 (m).", message.encoding);
    return false;
  }
  if (message.is_bigendian != 0) {
    *fault = "the image is big-endian, which is not supported.";
    return false;
  }
  const std::size_t pixel_bytes = millimetres ? 2 : 4;
  const std::size_t row_bytes = pixel_bytes * message.width;
  if (message.width == 0 || message.height == 0 || message.width > 8192 || message.height > 8192 ||
      message.step < row_bytes || message.step % pixel_bytes != 0 ||
      message.data.size() < static_cast<std::size_t>(message.step) * message.height) {
    *fault = fmt::format("the image's size ({} x {}), step ({}) and data ({} bytes) do not agree.",
                         message.width, message.height, message.step, message.data.size());
    return false;
  }
  // The view is only read; cv::Mat knows no const pixels.
  *view = cv::Mat(static_cast<int>(message.height), static_cast<int>(message.width),
                  millimetres ? CV_16UC1 : CV_32FC1, const_cast<std::uint8_t*>(message.data.data()),
                  message.step);
  return true;
}

cv::Mat make_depth_message(const std_msgs::Header& header, int width_px, int height_px,
                           sensor_msgs::Image* message) {
  message->header = header;
  message->width = static_cast<std::uint32_t>(width_px);
  message->height = static_cast<std::uint32_t>(height_px);
  message->encoding = sensor_msgs::image_encodings::TYPE_32FC1;
  message->is_bigendian = 0;
  message->step = message->width * 4;
  message->data.resize(static_cast<std::size_t>(message->step) * message->height);
  return cv::Mat(height_px, width_px, CV_32FC1, message->data.data(), message->step);
}

RawCamera raw_camera_from(const sensor_msgs::CameraInfo& info) {
  RawCamera camera;
  camera.raw.width_px = static_cast<int>(info.width);
  camera.raw.height_px = static_cast<int>(info.height);
  camera.raw.fx_px = info.K[0];
  camera.raw.fy_px = info.K[4];
  camera.raw.cx_px = info.K[2];
  camera.raw.cy_px = info.K[5];
  camera.distortion = info.D;
  camera.rectified = pinhole_from(info);
  return camera;
}

void rectified_info(const sensor_msgs::CameraInfo& raw, const PinholeModel& rectified,
                    sensor_msgs::CameraInfo* info) {
  *info = raw;
  info->distortion_model = sensor_msgs::distortion_models::PLUMB_BOB;
  info->D.assign(5, 0.0);
  info->K = {rectified.fx_px, 0.0, rectified.cx_px, 0.0, rectified.fy_px, rectified.cy_px, 0.0, 0.0, 1.0};
  info->R = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  info->P = {rectified.fx_px,
             0.0,
             rectified.cx_px,
             0.0,
             0.0,
             rectified.fy_px,
             rectified.cy_px,
             0.0,
             0.0,
             0.0,
             1.0,
             0.0};
}

}  // namespace knav
