#pragma once

#include <functional>
#include <memory>
#include <string>

#include "openni2_driver/openni2_camera_config.h"
#include "openni2_driver/openni_runtime.h"
#include "openni2_driver/sensor_frame.h"

namespace knav {

/// One device from its opening to its loss. Destroying it closes the streams, then the device.
/// All calls from one thread.
class OpenNISession {
 public:
  /// UserError if the device cannot be opened. `wake` is called from the driver's thread when a frame is
  /// ready.
  OpenNISession(std::shared_ptr<OpenNIRuntime> runtime, const ResolvedDevice& device,
                const OpenNIDeviceConfig& config, std::function<void()> wake);
  ~OpenNISession();

  /// Starts or stops a stream; UserError if the device has none or refuses the mode.
  void set_streaming(SensorStream stream, bool on);
  bool streaming(SensorStream stream) const;
  /// For streams started from now on; a stream that runs in another mode is stopped.
  void configure(const OpenNIDeviceConfig& config);
  /// Hands over one waiting frame, if there is one. Never blocks. UserError for a pixel format that is
  /// neither depth nor grey.
  bool read(const std::function<void(const SensorFrame&)>& handle);

  bool unplugged() const;
  bool at_end_of_file() const;

  const std::string& uri() const;
  const std::string& vendor() const;
  const std::string& name() const;
  const std::string& serial() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace knav
