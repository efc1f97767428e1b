// OpenNI2's driver for the Kinect v1, over libfreenect: raw disparity to millimetres beyond 20 m, and the IR
// image.

#include <cstdio>
#include <map>
#include <memory>
#include <mutex>

#include "openni2_driver/driver_gate.h"
#include "openni2_driver/kinect_v1/kinect_v1_device.h"

namespace knav {

class KinectV1Driver final : public oni::driver::DriverBase {
 public:
  explicit KinectV1Driver(OniDriverServices* services) : DriverBase(services) {}

  OniStatus initialize(oni::driver::DeviceConnectedCallback connected,
                       oni::driver::DeviceDisconnectedCallback disconnected,
                       oni::driver::DeviceStateChangedCallback state_changed, void* cookie) override {
    DriverBase::initialize(connected, disconnected, state_changed, cookie);
    DriverGate::open();
    loop_ = std::make_unique<FreenectLoop>(
        [this](const KinectOnUsb& kinect, bool here) { changed(kinect, here); });
    return ONI_STATUS_OK;
  }

  oni::driver::DeviceBase* deviceOpen(const char* uri, const char* /*mode*/) override {
    for (const KinectOnUsb& kinect : loop_->kinects()) {
      if (kinect.uri != uri) continue;
      auto device = std::make_unique<KinectV1Device>(*loop_, kinect);
      if (device->opened()) return device.release();
      getServices().errorLoggerAppend("libfreenect cannot open the Kinect '%s'", uri);
      return nullptr;
    }
    getServices().errorLoggerAppend("there is no Kinect '%s'", uri);
    return nullptr;
  }
  void deviceClose(oni::driver::DeviceBase* device) override { delete device; }
  void shutdown() override { loop_.reset(); }

 private:
  void changed(const KinectOnUsb& kinect, bool here) {
    OniDeviceInfo info{};
    std::snprintf(info.uri, sizeof(info.uri), "%s", kinect.uri.c_str());
    std::snprintf(info.vendor, sizeof(info.vendor), "Microsoft");
    std::snprintf(info.name, sizeof(info.name), "Kinect v1");
    info.usbVendorId = 0x045e;
    info.usbProductId = 0x02ae;
    // The runtime knows a device by the address of its description.
    OniDeviceInfo* known = nullptr;
    {
      std::lock_guard<std::mutex> lock(mutex_);
      known = &infos_.emplace(kinect.uri, info).first->second;
    }
    DriverGate::tell([&] {
      if (here) {
        deviceConnected(known);
      } else {
        deviceDisconnected(known);
      }
    });
  }

  std::mutex mutex_;
  std::map<std::string, OniDeviceInfo> infos_;
  std::unique_ptr<FreenectLoop> loop_;
};

}  // namespace knav

ONI_EXPORT_DRIVER(knav::KinectV1Driver)
