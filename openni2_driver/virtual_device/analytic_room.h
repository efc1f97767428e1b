#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "openni2_driver/virtual_device/frame_source.h"

namespace knav {

/// A room with a closed formula, so that tests know every pixel: floor 0.5 m below the camera, ceiling 2.0 m
/// above, side walls 3.0 m to the left and right, and a wall ahead at one of 381 distances, 1 to 20 m by 50
/// mm. It leaps through them in an order that covers the range within a second and tells the frame's number
/// modulo 381.
constexpr double kRoomFloorM = 0.5, kRoomCeilingM = 2.0, kRoomSideM = 3.0;
constexpr int kRoomNearestMm = 1000, kRoomStepMm = 50, kRoomSteps = 381, kRoomLeap = 97;

inline int room_wall_mm(uint64_t frame) {
  return kRoomNearestMm +
         kRoomStepMm * (static_cast<int>(frame % static_cast<uint64_t>(kRoomSteps)) * kRoomLeap % kRoomSteps);
}

/// The frame, modulo 381, that shows the wall at this distance; -1 if none does.
inline int room_frame_of_wall(int wall_mm) {
  for (int frame = 0; frame < kRoomSteps; ++frame) {
    if (room_wall_mm(static_cast<uint64_t>(frame)) == wall_mm) return frame;
  }
  return -1;
}

/// Depth [mm] along the optical axis of the nearest of floor, ceiling and side walls; without the wall ahead.
inline double room_shell_mm(int u, int v, const VirtualCamera& camera) {
  const double x = (u - camera.cx_px()) / camera.focal_px();
  const double y = (v - camera.cy_px()) / camera.focal_px();
  const double side_m = kRoomSideM / std::max(std::abs(x), 1e-9);
  const double level_m = (y > 0.0 ? kRoomFloorM : kRoomCeilingM) / std::max(std::abs(y), 1e-9);
  return 1000.0 * std::min(side_m, level_m);
}

inline uint16_t room_depth_mm(int u, int v, uint64_t frame, const VirtualCamera& camera) {
  return static_cast<uint16_t>(
      std::lround(std::min<double>(room_wall_mm(frame), room_shell_mm(u, v, camera))));
}

/// A chessboard with squares of 32 px that moves one column a frame.
inline uint16_t room_ir(int u, int v, uint64_t frame) {
  const auto column = (static_cast<uint64_t>(u) + frame) / 32, row = static_cast<uint64_t>(v) / 32;
  return (column + row) % 2 == 0 ? 800 : 200;
}

class AnalyticRoom final : public FrameSource {
 public:
  void render_depth(uint64_t frame, const VirtualCamera& camera, uint16_t* out) override {
    const auto pixels =
        static_cast<std::size_t>(camera.width_px) * static_cast<std::size_t>(camera.height_px);
    if (shell_mm_.size() != pixels) {
      shell_mm_.resize(pixels);
      for (int v = 0; v < camera.height_px; ++v) {
        for (int u = 0; u < camera.width_px; ++u) {
          shell_mm_[static_cast<std::size_t>(v * camera.width_px + u)] =
              static_cast<uint16_t>(std::min(std::lround(room_shell_mm(u, v, camera)), 65534L));
        }
      }
    }
    const auto wall_mm = static_cast<uint16_t>(room_wall_mm(frame));
    for (std::size_t i = 0; i < pixels; ++i) out[i] = std::min(wall_mm, shell_mm_[i]);
  }
  void render_ir(uint64_t frame, const VirtualCamera& camera, uint16_t* out) override {
    for (int v = 0; v < camera.height_px; ++v) {
      for (int u = 0; u < camera.width_px; ++u) out[v * camera.width_px + u] = room_ir(u, v, frame);
    }
  }

 private:
  std::vector<uint16_t> shell_mm_;
};

}  // namespace knav
