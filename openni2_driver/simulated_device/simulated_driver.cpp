// The OpenNI2 driver of simulated Kinects: every camera that a running simulator of this user shows
// (shared_camera.h) is a connected device kinect_nav_simulated/NAME.

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <map>
#include <mutex>
#include <thread>

#include "openni2_driver/driver_gate.h"
#include "openni2_driver/simulated_device/simulated_device.h"

namespace knav {
namespace {
constexpr std::chrono::milliseconds kLookPeriod(100);
constexpr char kUriPrefix[] = "kinect_nav_simulated/";
}  // namespace

class SimulatedDriver final : public oni::driver::DriverBase {
 public:
  explicit SimulatedDriver(OniDriverServices* services) : DriverBase(services) {}

  OniStatus initialize(oni::driver::DeviceConnectedCallback connected,
                       oni::driver::DeviceDisconnectedCallback disconnected,
                       oni::driver::DeviceStateChangedCallback state_changed, void* cookie) override {
    DriverBase::initialize(connected, disconnected, state_changed, cookie);
    DriverGate::open();
    look();
    watcher_ = std::thread([this] { watch(); });
    return ONI_STATUS_OK;
  }

  oni::driver::DeviceBase* deviceOpen(const char* uri, const char* /*mode*/) override {
    const std::string prefix = kUriPrefix, text = uri;
    std::shared_ptr<SharedCameraReader> camera;
    if (text.compare(0, prefix.size(), prefix) == 0)
      camera = SharedCameraReader::open(text.substr(prefix.size()));
    if (camera) return new SimulatedDevice(camera);
    getServices().errorLoggerAppend("no simulator shows the camera '%s' now", uri);
    return nullptr;
  }
  void deviceClose(oni::driver::DeviceBase* device) override { delete device; }

  void shutdown() override {
    {
      std::lock_guard<std::mutex> lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
    if (watcher_.joinable()) watcher_.join();
  }

 private:
  /// A camera that was seen; the runtime knows a device by the address of its description.
  struct Seen {
    OniDeviceInfo info{};
    std::shared_ptr<SharedCameraReader> camera;  ///< null while it is away
  };

  void look() {
    for (auto& [name, seen] : seen_) {
      if (!seen.camera || seen.camera->plugged()) continue;
      seen.camera.reset();
      DriverGate::tell([this, info = &seen.info] { deviceDisconnected(info); });
    }
    for (const std::string& name : shared_camera_names()) {
      Seen& seen = seen_[name];
      if (seen.camera) continue;
      seen.camera = SharedCameraReader::open(name);
      if (!seen.camera) continue;
      std::snprintf(seen.info.uri, sizeof(seen.info.uri), "%s%s", kUriPrefix, name.c_str());
      std::snprintf(seen.info.vendor, sizeof(seen.info.vendor), "kinect_nav");
      std::snprintf(seen.info.name, sizeof(seen.info.name), "simulated Kinect");
      DriverGate::tell([this, info = &seen.info] { deviceConnected(info); });
    }
  }

  void watch() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!wake_.wait_for(lock, kLookPeriod, [this] { return stop_; })) {
      lock.unlock();
      look();
      lock.lock();
    }
  }

  std::map<std::string, Seen> seen_;  // of the watcher, once it runs
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;
  std::thread watcher_;
};

}  // namespace knav

ONI_EXPORT_DRIVER(knav::SimulatedDriver)
