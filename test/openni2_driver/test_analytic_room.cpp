#include <gtest/gtest.h>

#include <set>

#include "openni2_driver/virtual_device/analytic_room.h"

using knav::VirtualCamera;

// By hand, 640x480: floor at row 479 is 0.5 m * 585 / 239.5 = 1221.29 mm; ceiling at row 0 is 2 m * 585 /
// 239.5 = 4885.18 mm; side at column 0 is 3 m * 585 / 319.5 = 5492.96 mm.
TEST(AnalyticRoom, HasTheWallsItSays) {
  const VirtualCamera camera;
  const uint64_t far_frame = static_cast<uint64_t>(knav::room_frame_of_wall(20000));
  EXPECT_EQ(knav::room_depth_mm(320, 479, far_frame, camera), 1221);
  EXPECT_EQ(knav::room_depth_mm(320, 0, far_frame, camera), 4885);
  EXPECT_EQ(knav::room_depth_mm(0, 240, far_frame, camera), 5493);
  EXPECT_EQ(knav::room_depth_mm(320, 240, far_frame, camera), 20000);
  EXPECT_EQ(knav::room_depth_mm(320, 479, 0, camera), 1000);
}

TEST(AnalyticRoom, EveryDistanceTellsItsFrame) {
  std::set<int> walls;
  for (uint64_t frame = 0; frame < 381; ++frame) {
    walls.insert(knav::room_wall_mm(frame));
    EXPECT_EQ(knav::room_frame_of_wall(knav::room_wall_mm(frame)), static_cast<int>(frame));
  }
  EXPECT_EQ(walls.size(), 381U);
  EXPECT_EQ(*walls.begin(), 1000);
  EXPECT_EQ(*walls.rbegin(), 20000);
}

TEST(AnalyticRoom, TheFastPathDrawsTheFormula) {
  for (const VirtualCamera camera : {VirtualCamera{640, 480}, VirtualCamera{320, 240}}) {
    knav::AnalyticRoom room;
    std::vector<uint16_t> image(static_cast<std::size_t>(camera.width_px * camera.height_px));
    for (uint64_t frame : {0ULL, 1ULL, 200ULL}) {
      room.render_depth(frame, camera, image.data());
      for (int v = 0; v < camera.height_px; ++v) {
        for (int u = 0; u < camera.width_px; ++u) {
          ASSERT_EQ(image[static_cast<std::size_t>(v * camera.width_px + u)],
                    knav::room_depth_mm(u, v, frame, camera));
        }
      }
    }
  }
}
