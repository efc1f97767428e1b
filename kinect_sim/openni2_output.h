#pragma once

#include <string>

#include "kinect_sim/simulator.h"
#include "openni2_driver/simulated_device/shared_camera.h"

namespace knav {

/// The simulated Kinect as an OpenNI2 device: renders what the driver wants into the memory it shares with
/// it. render() belongs to the thread that renders; the others to any.
class OpenNI2Output {
 public:
  /// UserError if there is such a device already. The device's URI is kinect_nav_simulated/NAME.
  OpenNI2Output(const std::string& name, const Simulator& simulator);
  bool wanted() const;
  void render(Simulator& simulator, const FrameRequest& request);
  void keep_alive() { writer_.keep_alive(); }
  void set_plugged(bool plugged) { writer_.set_plugged(plugged); }
  void set_streaming(bool streaming) { writer_.set_streaming(streaming); }

 private:
  SharedCameraWriter writer_;
};

}  // namespace knav
