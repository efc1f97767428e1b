#pragma once

#include <cstdint>

#include "openni2_driver/kinect_v1/disparity.h"

/// What the Kinects of scripted_freenect.cpp show, for the tests that look at it through the plugin. Which
/// are on the USB is told by a file of serial numbers, named by KINECT_NAV_SCRIPTED_KINECTS and read whenever
/// libfreenect is asked.
namespace knav::scripted {

constexpr int kWidth = 640, kHeight = 480, kInfraredHeight = 488;

/// A zero plane that is not the nominal one, so that depth tells whether it was asked for.
inline ZeroPlane zero_plane() { return {7.62, 118.5, 0.1049, 199.0}; }

/// Every code from 0 to 2047, moved on a little with every frame.
inline uint16_t code(int u, int v, unsigned frame) {
  return static_cast<uint16_t>((static_cast<unsigned>(v * kWidth + u) + 37U * (frame % 50U)) % 2048U);
}

/// 10 bits; the first pixel tells the frame.
inline uint16_t infrared(int u, int v, unsigned frame) {
  if (u == 0 && v == 0) return static_cast<uint16_t>(frame % 1024U);
  return static_cast<uint16_t>((static_cast<unsigned>(u) * 3U + static_cast<unsigned>(v) * 5U + frame) %
                               1024U);
}

constexpr uint32_t kTicksPerFrame = 2000000;  // of a 60 MHz clock

}  // namespace knav::scripted
