#pragma once

#include <string>
#include <vector>

namespace knav {

/// The device, its modes and how a lost one is waited for.
struct OpenNIDeviceConfig {
  std::string device_id = "#1";
  int width_px = 640;
  int height_px = 480;
  int rate_hz = 30;
  bool enable_reconnect = true;
  double reconnect_period_s = 1.0;
  double stall_timeout_s = 2.0;
  bool playback_repeat = true;

  template <class Visitor>
  void visit(Visitor& v) {
    v.text("device_id", device_id,
           "Which device: '#1' the first connected one, a serial number, an OpenNI2 URI, 'bus@number' of the "
           "USB, or "
           "the path of a .oni file.");
    v.integer("width_px", width_px, 80, 1600, "px",
              "Width of depth and IR images; a recording keeps its own.");
    v.integer("height_px", height_px, 60, 1280, "px",
              "Height of depth and IR images; a recording keeps its own.");
    v.integer("rate_hz", rate_hz, 1, 120, "Hz", "Frames a second; a recording keeps its own.");
    v.flag(
        "enable_reconnect", enable_reconnect,
        "Open the device again after it was unplugged or stalled; false: stay closed after the first loss.");
    v.number("reconnect_period_s", reconnect_period_s, 0.05, 60.0, "s",
             "Pause between two attempts to open the device.");
    v.number("stall_timeout_s", stall_timeout_s, 0.2, 60.0, "s",
             "A device that sends no frame for so long while it should is closed and opened again.");
    v.flag("playback_repeat", playback_repeat, "Start a .oni file again at its end; false: stop there.");
  }
  std::vector<std::string> validate() const {
    std::vector<std::string> faults;
    if (device_id.empty()) faults.push_back("'device_id' is empty; '#1' is the first device.");
    return faults;
  }
};

/// Everything kinect_nav/OpenNI2Camera can be told. Names, and the meaning of the time and pixel offsets, are
/// those of openni2_camera.
struct OpenNI2CameraConfig {
  OpenNIDeviceConfig device;
  std::string depth_frame_id = "camera_depth_optical_frame";
  std::string ir_frame_id = "camera_depth_optical_frame";
  std::string depth_camera_info_url;
  double depth_ir_offset_x = 5.0;
  double depth_ir_offset_y = 4.0;
  bool use_device_time = true;
  double depth_time_offset = -0.033;
  double ir_time_offset = -0.033;

  template <class Visitor>
  void visit(Visitor& v) {
    device.visit(v);
    v.text("depth_frame_id", depth_frame_id, "Frame of the depth images.");
    v.text("ir_frame_id", ir_frame_id,
           "Frame of the IR images; the Kinect's depth is seen from its IR camera.");
    v.text("depth_camera_info_url", depth_camera_info_url,
           "Calibration of the IR camera (camera_info_manager, name depth_SERIAL), from which that of the "
           "depth image "
           "follows. Empty: ${ROS_HOME}/camera_info/depth_SERIAL.yaml if there is one, else from the field "
           "of view.");
    v.number("depth_ir_offset_x", depth_ir_offset_x, -20.0, 20.0, "px",
             "With a calibration: the IR image's principal point minus the depth image's, at 640 columns.");
    v.number("depth_ir_offset_y", depth_ir_offset_y, -20.0, 20.0, "px", "The same in rows.");
    v.flag("use_device_time", use_device_time,
           "Stamp frames by the device's clock, mapped to ROS time; false: by their arrival.");
    v.number("depth_time_offset", depth_time_offset, -1.0, 1.0, "s", "Added to the stamps of depth images.");
    v.number("ir_time_offset", ir_time_offset, -1.0, 1.0, "s", "Added to the stamps of IR images.");
  }
  std::vector<std::string> validate() const {
    std::vector<std::string> faults = device.validate();
    if (depth_frame_id.empty())
      faults.push_back("'depth_frame_id' is empty; name the frame of the depth images.");
    if (ir_frame_id.empty()) faults.push_back("'ir_frame_id' is empty; name the frame of the IR images.");
    return faults;
  }
};

}  // namespace knav
