// The Kinect v1 plugin in the real runtime, over libfreenect's fakenect and a dump written here. Run by
// ctest, which puts our folder and fakenect's on LD_LIBRARY_PATH.

#include <gmock/gmock.h>

#include <cmath>

#include "fakenect_dump.h"
#include "openni2_driver/kinect_v1/disparity.h"
#include "virtual_device_fixture.h"

using knav::DeviceState;
using knav::OpenNIDeviceConfig;
using knav::SensorStream;
using knav::WatchedDevice;
using knav::fakenect::code_at;
using knav::fakenect::kDistinctFrames;
using knav::fakenect::kHeight;
using knav::fakenect::kWidth;
using testing::HasSubstr;

namespace {

constexpr int kFrames = 180;

/// fakenect plays its dump once in a process, so the tests share one and run in this order; the last sees its
/// end.
class KinectV1Test : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    directory_ = ::testing::TempDir() + "kinect_nav_dump_" + std::to_string(getpid());
    setenv("FAKENECT_PATH", directory_.c_str(), 1);
    knav::fakenect::write_dump(directory_, kFrames);
  }
  static void TearDownTestSuite() { std::filesystem::remove_all(directory_); }

  static std::string directory_;
};
std::string KinectV1Test::directory_;

}  // namespace

TEST_F(KinectV1Test, InfraredThatIsNotThereIsSaidNotHungOn) {
  WatchedDevice watched(OpenNIDeviceConfig{});
  watched.device.request(SensorStream::kInfrared, true);
  ASSERT_TRUE(knav::wait_until([&] { return !watched.faults().empty(); }));
  EXPECT_THAT(watched.faults().front(), HasSubstr("has no IR stream"));
  watched.device.request(SensorStream::kDepth, true);
  EXPECT_TRUE(watched.sends(3));
}

TEST_F(KinectV1Test, StartsStopsAndOpensAgain) {
  for (int round = 0; round < 2; ++round) {
    WatchedDevice watched(OpenNIDeviceConfig{});
    for (int times = 0; times < 2; ++times) {
      watched.device.request(SensorStream::kDepth, true);
      ASSERT_TRUE(watched.sends(5)) << watched.device.status().problem;
      watched.device.request(SensorStream::kDepth, false);
      ASSERT_TRUE(watched.reaches(DeviceState::kIdle));
    }
  }
}

TEST_F(KinectV1Test, RawDisparityArrivesAsMillimetresThenTheEndOfTheDumpIsAnUnplugging) {
  OpenNIDeviceConfig config;
  config.enable_reconnect = false;
  WatchedDevice watched(config, true);
  watched.device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(watched.reaches(DeviceState::kEnded, 20.0)) << watched.device.status().problem;
  EXPECT_THAT(watched.device.status().problem, HasSubstr("was unplugged"));
  EXPECT_EQ(watched.device.status().name, "Kinect v1");
  EXPECT_EQ(watched.device.status().uri, "kinect_v1/#1");

  const auto images = watched.images();
  ASSERT_GE(images.size(), 30U);
  const knav::DisparityTable table;
  const knav::ZeroPlane plane;
  int far_pixels = 0;
  for (std::size_t i = 0; i < images.size(); ++i) {
    // The corner's depth tells the frame.
    int frame = 0;
    while (frame < kDistinctFrames && table.mm(code_at(0, 0, frame)) != images[i].pixels[0]) ++frame;
    ASSERT_LT(frame, kDistinctFrames);
    int wrong = 0;
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const uint16_t mm = images[i].pixels[static_cast<std::size_t>(v * kWidth + u)];
        wrong += mm != table.mm(code_at(u, v, frame)) ? 1 : 0;
        far_pixels += mm > 10000 ? 1 : 0;
      }
    }
    EXPECT_EQ(wrong, 0) << "frame " << frame;
    if (i > 0) {
      const uint64_t step_us = images[i].device_time_us - images[i - 1].device_time_us;
      EXPECT_NEAR(static_cast<double>(step_us) / 33333.3, std::round(static_cast<double>(step_us) / 33333.3),
                  0.001);
      EXPECT_LT(step_us, 200000U);
    }
  }
  EXPECT_GT(far_pixels, 0) << "the stock driver's clamp at 10 m";
  EXPECT_NEAR(320.0 / std::tan(0.5 * images[0].horizontal_fov_rad), plane.focal_px(), 0.01);
}
