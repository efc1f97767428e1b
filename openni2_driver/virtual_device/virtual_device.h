#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "openni2_driver/plugin_device.h"
#include "openni2_driver/virtual_device/frame_source.h"

namespace knav {

/// The cable of a virtual device: shared by the driver, which pulls and plugs it, and the device's streams.
struct VirtualCable {
  std::atomic<bool> plugged{true};
  std::atomic<bool> streaming{true};
  /// When it was last plugged in [us of the steady clock]: frame 0.
  std::atomic<int64_t> plugged_at_us{0};
};

/// A stream that renders frame n at plugged_at + n / fps, with the device time 5 s + n / fps.
class VirtualStream final : public PluginStream {
 public:
  VirtualStream(OniSensorType type, std::shared_ptr<FrameSource> source, std::shared_ptr<VirtualCable> cable);
  ~VirtualStream() override;
  OniStatus start() override;
  void stop() override;

 protected:
  float horizontal_fov_rad(const OniVideoMode& mode) const override;
  float vertical_fov_rad(const OniVideoMode& mode) const override;

 private:
  void run();
  bool is_depth_;
  std::shared_ptr<FrameSource> source_;
  std::shared_ptr<VirtualCable> cable_;
  std::thread thread_;
};

class VirtualDevice final : public PluginDevice {
 public:
  VirtualDevice(int index, std::shared_ptr<VirtualCable> cable);
  oni::driver::StreamBase* createStream(OniSensorType type) override;
  void destroyStream(oni::driver::StreamBase* stream) override;

 private:
  std::shared_ptr<FrameSource> source_;
  std::shared_ptr<VirtualCable> cable_;
};

std::string virtual_serial(int index);
std::vector<OniVideoMode> virtual_modes(OniPixelFormat format);

}  // namespace knav
