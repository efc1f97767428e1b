#include <diagnostic_updater/diagnostic_updater.h>
#include <dynamic_reconfigure/server.h>
#include <kinect_nav/OpenNI2CameraConfig.h>

#include <atomic>
#include <cctype>
#include <memory>
#include <mutex>
#include <pluginlib/class_list_macros.hpp>

#include "openni2_driver/camera_publisher.h"
#include "openni2_driver/openni_device.h"
#include "ros_common/nodelet_base.h"
#include "ros_common/parameters.h"
#include "ros_common/reconfigure.h"

namespace knav {

/// kinect_nav/OpenNI2Camera: an OpenNI2 device's depth and IR images as openni2_camera publishes them.
class OpenNI2CameraNodelet final : public NodeletBase {
 public:
  ~OpenNI2CameraNodelet() override {
    timer_.stop();
    reconfigure_.reset();
    // First the device, whose thread uses the publishers; not under the lock, which that thread may be
    // waiting for.
    std::unique_ptr<OpenNIDevice> device;
    {
      std::lock_guard<std::mutex> lock(device_mutex_);
      device = std::move(device_);
    }
  }

 private:
  void start() override {
    config_ = read_parameters<OpenNI2CameraConfig>(getPrivateNodeHandle());
    ros::NodeHandle node = getNodeHandle();
    for (int i = 0; i < kSensorStreamCount; ++i) {
      const auto stream = static_cast<SensorStream>(i);
      publishers_[i] = std::make_unique<CameraPublisher>(node, stream, config_, [this, stream](bool any) {
        std::lock_guard<std::mutex> lock(device_mutex_);
        if (device_) device_->request(stream, any);
      });
    }
    updater_ = std::make_unique<diagnostic_updater::Updater>(node, getPrivateNodeHandle(), getName());
    updater_->setHardwareID("none");
    updater_->add("device", this, &OpenNI2CameraNodelet::diagnose);

    {
      std::lock_guard<std::mutex> lock(device_mutex_);
      device_ = std::make_unique<OpenNIDevice>(
          config_.device, [this](const SensorFrame& frame) { publish(frame); },
          [this](bool fault, const std::string& sentence) { report(fault, sentence); });
      // Whoever subscribed before the device existed.
      for (int i = 0; i < kSensorStreamCount; ++i) {
        device_->request(static_cast<SensorStream>(i), publishers_[i]->subscribed());
      }
    }
    // Wall time: diagnostics are wanted most when nothing drives a simulated clock.
    timer_ = node.createWallTimer(ros::WallDuration(0.5),
                                  [this](const ros::WallTimerEvent&) { updater_->update(); });
    reconfigure_ = std::make_unique<Reconfigure>(reconfigure_mutex_, getPrivateNodeHandle());
    reconfigure_->setCallback(
        [this](kinect_nav::OpenNI2CameraConfig& wanted, uint32_t) { reconfigure(wanted); });
  }

  void reconfigure(const kinect_nav::OpenNI2CameraConfig& wanted) {
    apply_reconfiguration(wanted, &config_);
    for (const auto& publisher : publishers_) publisher->configure(config_);
    std::lock_guard<std::mutex> lock(device_mutex_);
    if (device_) device_->configure(config_.device);
  }

  void publish(const SensorFrame& frame) {
    publishers_[static_cast<int>(frame.stream)]->publish(frame, ros::Time::now().toSec(), calibration_.get());
    offset_s_ = publishers_[static_cast<int>(frame.stream)]->clock_offset_s();
  }

  // Called from the device's thread, as publish() is.
  void report(bool fault, const std::string& sentence) {
    if (fault) {
      NODELET_WARN("%s: %s", getName().c_str(), sentence.c_str());
      return;
    }
    NODELET_INFO("%s: %s", getName().c_str(), sentence.c_str());
    load_calibration();
  }

  /// The calibration belongs to a device, so it is looked for when the serial number is known.
  void load_calibration() {
    DeviceStatus status;
    {
      std::lock_guard<std::mutex> lock(device_mutex_);
      if (!device_) return;
      status = device_->status();
    }
    std::string name = "depth_" + (status.serial.empty() ? std::string("camera") : status.serial);
    for (char& c : name) {
      if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
    }
    if (calibration_ && name == calibration_name_) return;
    calibration_name_ = name;
    ros::NodeHandle ir(getNodeHandle(), "camera/ir");
    calibration_.reset();
    calibration_ =
        std::make_unique<camera_info_manager::CameraInfoManager>(ir, name, config_.depth_camera_info_url);
    if (!calibration_->isCalibrated()) {
      NODELET_INFO("%s: no calibration of the IR camera; camera_info comes from the device's field of view.",
                   getName().c_str());
    }
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& out) {
    using Level = diagnostic_msgs::DiagnosticStatus;
    DeviceStatus status;
    {
      std::lock_guard<std::mutex> lock(device_mutex_);
      if (!device_) return;
      status = device_->status();
    }
    if (!status.serial.empty()) updater_->setHardwareID(status.serial);
    const bool well = status.state == DeviceState::kIdle || status.state == DeviceState::kStreaming;
    out.summary(!well                    ? Level::ERROR
                : status.problem.empty() ? Level::OK
                                         : Level::WARN,
                status.problem.empty() ? to_string(status.state) : status.problem);
    const uint64_t frames[] = {status.frames[0], status.frames[1]};
    const ros::WallTime now = ros::WallTime::now();
    const double seconds = (now - last_diagnosis_).toSec();
    out.add("state", to_string(status.state));
    out.add("device_id", config_.device.device_id);
    out.add("uri", status.uri);
    out.add("vendor", status.vendor);
    out.add("name", status.name);
    out.add("serial number", status.serial);
    out.add("openings", status.openings);
    out.add("disconnections", status.disconnections);
    out.add("stalls", status.stalls);
    out.add("recoveries", status.recoveries);
    out.addf("waited for the first opening [s]", "%.1f", status.waited_s);
    out.addf("last outage [s]", "%.1f", status.last_outage_s);
    out.add("last event", status.last_event);
    out.addf("last event's age [s]", "%.1f", status.last_event_age_s);
    const char* names[] = {"depth", "ir"};
    for (int i = 0; i < kSensorStreamCount; ++i) {
      const std::string name = names[i];
      out.add(name + " frames", frames[i]);
      out.add(name + " frames missed", status.missed_frames[i]);
      const bool measured = !last_diagnosis_.isZero() && seconds > 0.0;
      out.addf(name + " rate [Hz]", "%.1f",
               measured ? static_cast<double>(frames[i] - last_frames_[i]) / seconds : 0.0);
      last_frames_[i] = frames[i];
    }
    out.addf("host minus device clock [s]", "%.6f", offset_s_.load());
    last_diagnosis_ = now;
  }

  using Reconfigure = dynamic_reconfigure::Server<kinect_nav::OpenNI2CameraConfig>;

  OpenNI2CameraConfig config_;  // what can be changed: under reconfigure_mutex_
  boost::recursive_mutex reconfigure_mutex_;
  std::unique_ptr<Reconfigure> reconfigure_;
  std::unique_ptr<CameraPublisher> publishers_[kSensorStreamCount];
  std::unique_ptr<camera_info_manager::CameraInfoManager> calibration_;  // of the device's thread
  std::string calibration_name_;
  std::atomic<double> offset_s_{0.0};

  std::unique_ptr<diagnostic_updater::Updater> updater_;
  ros::WallTimer timer_;
  ros::WallTime last_diagnosis_;
  uint64_t last_frames_[kSensorStreamCount] = {0, 0};

  std::mutex device_mutex_;  // guards the pointer
  std::unique_ptr<OpenNIDevice> device_;
};

}  // namespace knav

PLUGINLIB_EXPORT_CLASS(knav::OpenNI2CameraNodelet, nodelet::Nodelet)
