#include "openni2_driver/camera_publisher.h"

#include <sensor_msgs/distortion_models.h>
#include <sensor_msgs/image_encodings.h>

#include "openni2_driver/camera_info.h"

namespace knav {

sensor_msgs::CameraInfoPtr scaled_camera_info(const sensor_msgs::CameraInfo& calibration, int width_px,
                                              int height_px, double offset_x_px, double offset_y_px) {
  if (calibration.width == 0 || calibration.height == 0 ||
      static_cast<int>(calibration.width) * height_px != static_cast<int>(calibration.height) * width_px) {
    return nullptr;
  }
  auto info = boost::make_shared<sensor_msgs::CameraInfo>(calibration);
  const double scale = static_cast<double>(width_px) / static_cast<double>(calibration.width);
  info->width = static_cast<uint32_t>(width_px);
  info->height = static_cast<uint32_t>(height_px);
  // Pixel centres are whole numbers: a principal point c becomes (c + 0.5) s - 0.5.
  const auto move = [scale](double c, double offset_px) { return (c + 0.5) * scale - 0.5 - offset_px; };
  const double offset_x = offset_x_px * width_px / 640.0, offset_y = offset_y_px * width_px / 640.0;
  info->K[0] *= scale;
  info->K[4] *= scale;
  info->K[2] = move(info->K[2], offset_x);
  info->K[5] = move(info->K[5], offset_y);
  info->P[0] *= scale;
  info->P[5] *= scale;
  info->P[2] = move(info->P[2], offset_x);
  info->P[6] = move(info->P[6], offset_y);
  return info;
}

CameraPublisher::CameraPublisher(ros::NodeHandle& node, SensorStream stream,
                                 const OpenNI2CameraConfig& config, std::function<void(bool)> on_subscribers)
    : stream_(stream) {
  const bool depth = stream == SensorStream::kDepth;
  frame_id_ = depth ? config.depth_frame_id : config.ir_frame_id;
  configure(config);
  const ros::SubscriberStatusCallback changed =
      [this, on_subscribers](const ros::SingleSubscriberPublisher&) { on_subscribers(subscribed()); };
  const std::string image_topic = depth ? "camera/depth/image_raw" : "camera/ir/image";
  const std::string info_topic = depth ? "camera/depth/camera_info" : "camera/ir/camera_info";
  std::lock_guard<std::mutex> lock(mutex_);
  image_ = node.advertise<sensor_msgs::Image>(image_topic, 4, changed, changed);
  info_ = node.advertise<sensor_msgs::CameraInfo>(info_topic, 4, changed, changed);
}

void CameraPublisher::configure(const OpenNI2CameraConfig& config) {
  const bool depth = stream_ == SensorStream::kDepth;
  std::lock_guard<std::mutex> lock(mutex_);
  settings_.use_device_time = config.use_device_time;
  settings_.time_offset_s = depth ? config.depth_time_offset : config.ir_time_offset;
  settings_.principal_offset_x_px = depth ? config.depth_ir_offset_x : 0.0;
  settings_.principal_offset_y_px = depth ? config.depth_ir_offset_y : 0.0;
}

bool CameraPublisher::subscribed() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return image_.getNumSubscribers() + info_.getNumSubscribers() > 0;
}

sensor_msgs::CameraInfoPtr CameraPublisher::camera_info(
    const SensorFrame& frame, const Settings& settings,
    camera_info_manager::CameraInfoManager* calibration) const {
  if (calibration != nullptr && calibration->isCalibrated()) {
    auto info = scaled_camera_info(calibration->getCameraInfo(), frame.width_px, frame.height_px,
                                   settings.principal_offset_x_px, settings.principal_offset_y_px);
    if (info) return info;
    ROS_WARN_ONCE("The IR camera's calibration has other proportions than its %dx%d images; it is not used.",
                  frame.width_px, frame.height_px);
  }
  const PinholeModel model =
      nominal_model(frame.width_px, frame.height_px, frame.horizontal_fov_rad, frame.vertical_fov_rad);
  auto info = boost::make_shared<sensor_msgs::CameraInfo>();
  info->width = static_cast<uint32_t>(model.width_px);
  info->height = static_cast<uint32_t>(model.height_px);
  info->distortion_model = sensor_msgs::distortion_models::PLUMB_BOB;
  info->D.assign(5, 0.0);
  info->K = {model.fx_px, 0.0, model.cx_px, 0.0, model.fy_px, model.cy_px, 0.0, 0.0, 1.0};
  info->R = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  info->P = {model.fx_px, 0.0, model.cx_px, 0.0, 0.0, model.fy_px, model.cy_px, 0.0, 0.0, 0.0, 1.0, 0.0};
  return info;
}

void CameraPublisher::publish(const SensorFrame& frame, double now_s,
                              camera_info_manager::CameraInfoManager* calibration) {
  Settings settings;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    settings = settings_;
  }
  // Kept up even when the device's time is not used, for the diagnostics.
  const double device_s = clock_.to_host_s(frame.device_time_us, now_s);
  const double stamp_s = (settings.use_device_time ? device_s : now_s) + settings.time_offset_s;
  const ros::Time stamp(std::max(stamp_s, 0.0));

  auto image = boost::make_shared<sensor_msgs::Image>();
  image->header.stamp = stamp;
  image->header.frame_id = frame_id_;
  image->width = static_cast<uint32_t>(frame.width_px);
  image->height = static_cast<uint32_t>(frame.height_px);
  image->step = image->width * static_cast<uint32_t>(sizeof(uint16_t));
  image->encoding = stream_ == SensorStream::kDepth ? sensor_msgs::image_encodings::TYPE_16UC1
                                                    : sensor_msgs::image_encodings::MONO16;
  image->data.resize(static_cast<std::size_t>(image->step) * image->height);
  copy_pixels(frame, reinterpret_cast<uint16_t*>(image->data.data()));

  sensor_msgs::CameraInfoPtr info = camera_info(frame, settings, calibration);
  info->header = image->header;
  image_.publish(image);
  info_.publish(info);
}

}  // namespace knav
