#pragma once

#include <memory>
#include <thread>

#include "openni2_driver/plugin_device.h"
#include "openni2_driver/simulated_device/shared_camera.h"

namespace knav {

/// One stream of a simulator's Kinect: the frames of the shared memory, with the simulator's time as the
/// device's.
class SimulatedStream final : public PluginStream {
 public:
  SimulatedStream(OniSensorType type, std::shared_ptr<SharedCameraReader> camera);
  ~SimulatedStream() override;
  OniStatus start() override;
  void stop() override;

 protected:
  float horizontal_fov_rad(const OniVideoMode& mode) const override;
  float vertical_fov_rad(const OniVideoMode& mode) const override;

 private:
  void run();
  SharedStream which_;
  std::shared_ptr<SharedCameraReader> camera_;
  std::thread thread_;
};

class SimulatedDevice final : public PluginDevice {
 public:
  explicit SimulatedDevice(std::shared_ptr<SharedCameraReader> camera);
  oni::driver::StreamBase* createStream(OniSensorType type) override;
  void destroyStream(oni::driver::StreamBase* stream) override;

 private:
  std::shared_ptr<SharedCameraReader> camera_;
};

}  // namespace knav
