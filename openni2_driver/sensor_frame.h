#pragma once

#include <cstdint>

namespace knav {

enum class SensorStream { kDepth = 0, kInfrared = 1 };
constexpr int kSensorStreamCount = 2;

/// One image of an OpenNI2 device. The pixels live only while the handler runs.
struct SensorFrame {
  SensorStream stream = SensorStream::kDepth;
  const uint16_t* pixels = nullptr;  ///< depth in units of 1 / units_per_mm, 0 invalid; or IR intensity
  int width_px = 0;
  int height_px = 0;
  int stride_px = 0;     ///< from one row's start to the next's
  int units_per_mm = 1;  ///< depth: 1, or 10 for devices that count in 100 um
  bool mirrored =
      false;  ///< columns run from right to left (a device or recording that cannot be told otherwise)
  uint64_t device_time_us = 0;  ///< from an arbitrary zero
  int index = 0;
  double horizontal_fov_rad = 0.0;
  double vertical_fov_rad = 0.0;
};

/// Copies the pixels as an upright, unmirrored image of width_px * height_px values; depth in millimetres.
void copy_pixels(const SensorFrame& frame, uint16_t* out);

}  // namespace knav
