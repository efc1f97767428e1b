#pragma once

#include <mutex>
#include <string>
#include <vector>

#include "openni2_driver/kinect_v1/disparity.h"
#include "openni2_driver/kinect_v1/freenect_loop.h"
#include "openni2_driver/kinect_v1/tick_clock.h"
#include "openni2_driver/plugin_device.h"

namespace knav {

class KinectV1Device;

/// Depth in millimetres, or the upper 480 of the IR image's 488 rows.
class KinectV1Stream final : public PluginStream {
 public:
  KinectV1Stream(OniSensorType type, KinectV1Device& device);
  ~KinectV1Stream() override;
  OniStatus start() override;
  void stop() override;
  /// From the loop's thread: raw codes for depth, intensities for IR.
  void send(const uint16_t* raw, uint64_t time_us);
  OniSensorType type() const { return type_; }

 protected:
  float horizontal_fov_rad(const OniVideoMode& mode) const override;
  float vertical_fov_rad(const OniVideoMode& mode) const override;

 private:
  OniSensorType type_;
  KinectV1Device& device_;
  int index_ = 0;
};

class KinectV1Device final : public PluginDevice, public KinectFrames {
 public:
  /// `opened()` tells whether it worked.
  KinectV1Device(FreenectLoop& loop, const KinectOnUsb& kinect);
  ~KinectV1Device() override;
  bool opened() const { return handle_ != nullptr; }

  oni::driver::StreamBase* createStream(OniSensorType type) override;
  void destroyStream(oni::driver::StreamBase* stream) override;

  void on_depth(const uint16_t* codes, uint32_t ticks) override;
  void on_ir(const uint16_t* pixels, uint32_t ticks) override;

 private:
  friend class KinectV1Stream;
  FreenectLoop& loop_;
  freenect_device* handle_ = nullptr;
  ZeroPlane plane_;
  DisparityTable table_;
  TickClock depth_clock_, ir_clock_;
  std::mutex mutex_;  // guards the two below
  KinectV1Stream *depth_ = nullptr, *ir_ = nullptr;
};

}  // namespace knav
