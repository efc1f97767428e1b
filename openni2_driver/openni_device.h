#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <string>

#include "openni2_driver/openni2_camera_config.h"
#include "openni2_driver/openni_session.h"
#include "openni2_driver/sensor_frame.h"

namespace knav {

enum class DeviceState {
  kSearching,  ///< not there (yet, or any more)
  kIdle,       ///< open, nobody wants images
  kStreaming,
  kStalled,  ///< open, images wanted, none came
  kEnded     ///< a recording at its end, or lost without enable_reconnect
};
const char* to_string(DeviceState state);

struct DeviceStatus {
  DeviceState state = DeviceState::kSearching;
  std::string problem;  ///< why there are no images; empty if there are or nobody wants them
  std::string uri, vendor, name, serial;
  int openings = 0;
  int disconnections = 0;
  int stalls = 0;
  int recoveries = 0;  ///< times frames (or, if nobody wants any, the device) were back after a loss or stall
  double waited_s = 0.0;       ///< from the start to the first opening, or until now
  double last_outage_s = 0.0;  ///< from the last loss or stall to its recovery, or until now
  std::string last_event;      ///< the last sentence told to the event handler
  double last_event_age_s = 0.0;
  uint64_t frames[kSensorStreamCount] = {0, 0};
  uint64_t missed_frames[kSensorStreamCount] = {0, 0};  ///< gaps in the frame index
};

/// An OpenNI2 device or .oni file that is opened when it is there, read while somebody wants images, and
/// found again after it was unplugged or stalled. A thread of its own owns everything of OpenNI2.
class OpenNIDevice {
 public:
  using FrameHandler = std::function<void(const SensorFrame&)>;
  /// @param fault true for a loss or a problem, false for its end
  using EventHandler = std::function<void(bool fault, const std::string& sentence)>;

  /// Returns at once, whether the device is there or not. Handlers are called from the device's thread; an
  /// event is told once, however long it lasts.
  OpenNIDevice(const OpenNIDeviceConfig& config, FrameHandler on_frame, EventHandler on_event);
  ~OpenNIDevice();
  OpenNIDevice(const OpenNIDevice&) = delete;
  OpenNIDevice& operator=(const OpenNIDevice&) = delete;

  /// Images of this stream are wanted, or no longer.
  void request(SensorStream stream, bool on);
  /// All but device_id takes effect while it runs; a stream in another mode is started anew.
  void configure(const OpenNIDeviceConfig& config);
  DeviceStatus status() const;

 private:
  void run();
  bool stopping() const;
  void wait(double seconds);
  bool open();
  void close(DeviceState state, const std::string& problem);
  void apply_requests();
  void read_frames();
  void take_new_config();
  void report_problem(const std::string& problem);
  void tell(bool fault, const std::string& sentence);
  void begin_outage();
  void end_outage();
  void deliver(const SensorFrame& frame);

  OpenNIDeviceConfig config_;
  FrameHandler on_frame_;
  EventHandler on_event_;

  mutable std::mutex mutex_;  // guards the following
  std::condition_variable wake_;
  bool stop_ = false, woken_ = false;
  bool wanted_[kSensorStreamCount] = {false, false};
  DeviceStatus status_;
  std::unique_ptr<OpenNIDeviceConfig> new_config_;
  double started_s_ = 0.0, outage_since_s_ = -1.0, last_event_s_ = 0.0;  // steady clock; -1: no outage

  // Only the device's thread uses these.
  std::shared_ptr<OpenNIRuntime> runtime_;  // kept while the device is away: starting it anew is slow
  std::unique_ptr<OpenNISession> session_;
  double last_frame_s_ = 0.0;
  double next_start_s_ = 0.0;  // a stream that did not start is not tried again before
  int last_index_[kSensorStreamCount] = {-1, -1};
  std::string reported_;
  bool lost_ = false;  // was unplugged: that it is not there has been said
  bool ended_ = false;

  std::future<void> finished_;
};

}  // namespace knav
