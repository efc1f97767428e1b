// The OpenNI2 driver of the virtual devices: KINECT_NAV_VIRTUAL_DEVICES of them (1), their cable in the hands
// of the control file (control_file.h). Linked with one definition of make_frame_source().

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "openni2_driver/driver_gate.h"
#include "openni2_driver/virtual_device/control_file.h"
#include "openni2_driver/virtual_device/virtual_device.h"

namespace knav {
namespace {

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

int64_t steady_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace

class VirtualDriver final : public oni::driver::DriverBase {
 public:
  explicit VirtualDriver(OniDriverServices* services)
      : DriverBase(services), control_path_(environment("KINECT_NAV_VIRTUAL_CONTROL")) {}

  OniStatus initialize(oni::driver::DeviceConnectedCallback connected,
                       oni::driver::DeviceDisconnectedCallback disconnected,
                       oni::driver::DeviceStateChangedCallback state_changed, void* cookie) override {
    DriverBase::initialize(connected, disconnected, state_changed, cookie);
    DriverGate::open();
    const std::string count = environment("KINECT_NAV_VIRTUAL_DEVICES");
    const int devices = count.empty() ? 1 : std::clamp(std::atoi(count.c_str()), 0, 8);
    for (int i = 0; i < devices; ++i) {
      Slot slot;
      std::snprintf(slot.info.uri, sizeof(slot.info.uri), "kinect_nav_virtual/%d", i);
      std::snprintf(slot.info.vendor, sizeof(slot.info.vendor), "kinect_nav");
      std::snprintf(slot.info.name, sizeof(slot.info.name), "virtual Kinect");
      slot.cable->plugged = false;
      slots_.push_back(slot);
    }
    apply(read_control_file(control_path_));
    if (!control_path_.empty()) {
      running_ = true;
      watcher_ = std::thread([this] { watch(); });
    }
    return ONI_STATUS_OK;
  }

  oni::driver::DeviceBase* deviceOpen(const char* uri, const char* /*mode*/) override {
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      if (std::string(uri) == slots_[i].info.uri && slots_[i].cable->plugged) {
        return new VirtualDevice(static_cast<int>(i), slots_[i].cable);
      }
    }
    getServices().errorLoggerAppend("virtual device '%s' is not plugged in", uri);
    return nullptr;
  }
  void deviceClose(oni::driver::DeviceBase* device) override { delete device; }

  void shutdown() override {
    running_ = false;
    if (watcher_.joinable()) watcher_.join();
  }

 private:
  struct Slot {
    OniDeviceInfo info{};
    std::shared_ptr<VirtualCable> cable = std::make_shared<VirtualCable>();
  };

  void apply(const VirtualControl& control) {
    for (Slot& slot : slots_) {
      slot.cable->streaming = control.streaming;
      if (control.plugged == slot.cable->plugged) continue;
      if (control.plugged) slot.cable->plugged_at_us = steady_us();
      slot.cable->plugged = control.plugged;
      if (control.plugged) {
        DriverGate::tell([&] { deviceConnected(&slot.info); });
      } else {
        DriverGate::tell([&] { deviceDisconnected(&slot.info); });
      }
    }
  }

  void watch() {
    while (running_) {
      apply(read_control_file(control_path_));
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }

  std::string control_path_;
  std::vector<Slot> slots_;
  std::atomic<bool> running_{false};
  std::thread watcher_;
};

}  // namespace knav

ONI_EXPORT_DRIVER(knav::VirtualDriver)
