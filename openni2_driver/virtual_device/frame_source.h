#pragma once

#include <cstdint>
#include <memory>

namespace knav {

/// The camera a virtual device pretends to be: a pinhole without distortion, its principal point in the
/// middle.
struct VirtualCamera {
  int width_px = 640;
  int height_px = 480;
  double focal_px() const { return 585.0 * width_px / 640.0; }
  double cx_px() const { return 0.5 * (width_px - 1); }
  double cy_px() const { return 0.5 * (height_px - 1); }
};

/// What a virtual OpenNI2 device shows. The device calls it from one thread a stream, never twice at a time
/// for one stream.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  /// @param frame counts from 0 at the plugging in of the device
  /// @param out width x height depths [mm], 0 invalid
  virtual void render_depth(uint64_t frame, const VirtualCamera& camera, uint16_t* out) = 0;
  /// @param out width x height intensities, 10 bits
  virtual void render_ir(uint64_t frame, const VirtualCamera& camera, uint16_t* out) = 0;
};

/// Defined once in every plugin that is built from virtual_driver.cpp.
/// @param device counts from 0
std::unique_ptr<FrameSource> make_frame_source(int device);

}  // namespace knav
