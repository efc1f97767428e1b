#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "openni2_driver/camera_info.h"
#include "openni2_driver/sensor_frame.h"

using knav::SensorFrame;

namespace {
SensorFrame frame_of(const std::vector<uint16_t>& pixels, int width, int height, int stride) {
  SensorFrame frame;
  frame.pixels = pixels.data();
  frame.width_px = width;
  frame.height_px = height;
  frame.stride_px = stride;
  return frame;
}
}  // namespace

TEST(SensorFrame, PaddingBetweenRowsIsLeftOut) {
  const std::vector<uint16_t> pixels = {1, 2, 99, 3, 4};
  std::vector<uint16_t> out(4);
  copy_pixels(frame_of(pixels, 2, 2, 3), out.data());
  EXPECT_EQ(out, (std::vector<uint16_t>{1, 2, 3, 4}));
}

TEST(SensorFrame, AMirroredImageIsTurnedBack) {
  const std::vector<uint16_t> pixels = {1, 2, 3, 4, 5, 6};
  SensorFrame frame = frame_of(pixels, 3, 2, 3);
  frame.mirrored = true;
  std::vector<uint16_t> out(6);
  copy_pixels(frame, out.data());
  EXPECT_EQ(out, (std::vector<uint16_t>{3, 2, 1, 6, 5, 4}));
}

TEST(SensorFrame, TenthsOfMillimetresAreRounded) {
  const std::vector<uint16_t> pixels = {0, 4, 5, 12344, 65535};
  SensorFrame frame = frame_of(pixels, 5, 1, 5);
  frame.units_per_mm = 10;
  std::vector<uint16_t> out(5);
  copy_pixels(frame, out.data());
  EXPECT_EQ(out, (std::vector<uint16_t>{0, 0, 1, 1234, 6554}));
}

TEST(NominalModel, FollowsTheFieldsOfView) {
  const knav::PinholeModel model =
      knav::nominal_model(640, 480, 2.0 * std::atan(320.0 / 585.0), 2.0 * std::atan(0.5));
  EXPECT_NEAR(model.fx_px, 585.0, 1e-9);
  EXPECT_NEAR(model.fy_px, 480.0, 1e-9);
  EXPECT_EQ(model.cx_px, 319.5);
  EXPECT_EQ(model.cy_px, 239.5);
}

TEST(NominalModel, AViewUntoldIsTheOtherOnesOrTheKinects) {
  EXPECT_NEAR(knav::nominal_model(640, 480, 0.0, 2.0 * std::atan(0.5)).fx_px, 480.0, 1e-9);
  EXPECT_NEAR(knav::nominal_model(320, 240, std::nan(""), 0.0).fx_px, 292.5, 1e-9);
}
