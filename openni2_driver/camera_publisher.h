#pragma once

#include <camera_info_manager/camera_info_manager.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "openni2_driver/device_clock.h"
#include "openni2_driver/openni2_camera_config.h"
#include "openni2_driver/sensor_frame.h"

namespace knav {

/// One stream's image and camera_info topics. Everything but the subscriber's comings and goings happens in
/// the device's thread.
class CameraPublisher {
 public:
  /// @param on_subscribers called with whether anybody listens, whenever that may have changed
  CameraPublisher(ros::NodeHandle& node, SensorStream stream, const OpenNI2CameraConfig& config,
                  std::function<void(bool)> on_subscribers);
  bool subscribed() const;
  /// Offsets and the choice of the clock may change while it runs; frame and topics stay.
  void configure(const OpenNI2CameraConfig& config);
  /// Images and camera_info with the same stamp. `calibration` may be null.
  void publish(const SensorFrame& frame, double now_s, camera_info_manager::CameraInfoManager* calibration);
  double clock_offset_s() const { return clock_.offset_s(); }

 private:
  struct Settings {
    bool use_device_time = true;
    double time_offset_s = 0.0, principal_offset_x_px = 0.0, principal_offset_y_px = 0.0;
  };
  sensor_msgs::CameraInfoPtr camera_info(const SensorFrame& frame, const Settings& settings,
                                         camera_info_manager::CameraInfoManager* calibration) const;

  SensorStream stream_;
  std::string frame_id_;
  DeviceClock clock_;
  mutable std::mutex
      mutex_;  // of the settings; and a subscriber may come while the topics are being advertised
  Settings settings_;
  ros::Publisher image_, info_;
};

/// The camera_info of a depth image from that of the IR camera, or of the IR image itself (offset 0): scaled
/// to the image's size, the principal point moved. Null if the calibration's proportions are not the image's.
sensor_msgs::CameraInfoPtr scaled_camera_info(const sensor_msgs::CameraInfo& calibration, int width_px,
                                              int height_px, double offset_x_px, double offset_y_px);

}  // namespace knav
