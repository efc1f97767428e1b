// The real OpenNI2 runtime on the virtual device. Run by ctest, which puts the plugin's folder on
// LD_LIBRARY_PATH.

#include <gmock/gmock.h>

#include <cmath>

#include "virtual_device_fixture.h"

using knav::DeviceState;
using knav::OpenNIDeviceConfig;
using knav::SensorStream;
using knav::VirtualCamera;
using knav::VirtualDeviceTest;
using knav::WatchedDevice;
using testing::HasSubstr;

namespace {
OpenNIDeviceConfig quick_config() {
  OpenNIDeviceConfig config;
  config.reconnect_period_s = 0.1;
  config.stall_timeout_s = 0.4;
  return config;
}
}  // namespace

TEST_F(VirtualDeviceTest, DepthArrivesExactly) {
  WatchedDevice watched(quick_config(), true);
  watched.device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(watched.sends(20));
  const auto images = watched.images();
  for (const auto& image : images) {
    ASSERT_EQ(image.width_px, 640);
    ASSERT_EQ(image.height_px, 480);
    EXPECT_EQ(knav::wrong_pixels(image.pixels, static_cast<uint64_t>(image.index), VirtualCamera{640, 480}),
              0);
    EXPECT_EQ(image.device_time_us, 5000000U + static_cast<uint64_t>(std::llround(image.index * 1e6 / 30.0)));
    EXPECT_NEAR(320.0 / std::tan(0.5 * image.horizontal_fov_rad), 585.0, 1e-3);
  }
  const auto status = watched.device.status();
  EXPECT_EQ(status.serial, "VIRTUAL0001");
  EXPECT_EQ(status.state, DeviceState::kStreaming);
  EXPECT_EQ(status.problem, "");
}

TEST_F(VirtualDeviceTest, InfraredArrivesBesideDepth) {
  WatchedDevice watched(quick_config(), true);
  watched.device.request(SensorStream::kInfrared, true);
  watched.device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(watched.sends(10, SensorStream::kInfrared));
  ASSERT_TRUE(watched.sends(10, SensorStream::kDepth));
  for (const auto& image : watched.images()) {
    if (image.stream != SensorStream::kInfrared) continue;
    int wrong = 0;
    for (int v = 0; v < 480; ++v) {
      for (int u = 0; u < 640; ++u) {
        wrong += image.pixels[static_cast<std::size_t>(v * 640 + u)] !=
                 knav::room_ir(u, v, static_cast<uint64_t>(image.index));
      }
    }
    EXPECT_EQ(wrong, 0);
  }
}

TEST_F(VirtualDeviceTest, OtherModesAreChosenByTheirNumbers) {
  OpenNIDeviceConfig config = quick_config();
  config.width_px = 320;
  config.height_px = 240;
  config.rate_hz = 60;
  WatchedDevice watched(config, true);
  watched.device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(watched.sends(5));
  const auto image = watched.images().back();
  EXPECT_EQ(image.width_px, 320);
  EXPECT_EQ(knav::wrong_pixels(image.pixels, static_cast<uint64_t>(image.index), VirtualCamera{320, 240}), 0);
}

TEST_F(VirtualDeviceTest, AModeItDoesNotHaveIsNamedWithThoseItHas) {
  OpenNIDeviceConfig config = quick_config();
  config.rate_hz = 25;
  WatchedDevice watched(config);
  watched.device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(knav::wait_until([&] { return !watched.faults().empty(); }));
  EXPECT_THAT(watched.faults().front(), HasSubstr("640x480@25"));
  EXPECT_THAT(watched.faults().front(), HasSubstr("640x480@30"));
  EXPECT_THAT(watched.device.status().problem, HasSubstr("640x480@25"));
}

TEST_F(VirtualDeviceTest, StreamsOnlyWhileImagesAreWanted) {
  WatchedDevice watched(quick_config());
  ASSERT_TRUE(watched.reaches(DeviceState::kIdle));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_EQ(watched.frames(), 0);
  for (int round = 0; round < 3; ++round) {
    watched.device.request(SensorStream::kDepth, true);
    ASSERT_TRUE(watched.sends(3));
    watched.device.request(SensorStream::kDepth, false);
    ASSERT_TRUE(watched.reaches(DeviceState::kIdle));
    const int before = watched.frames();
    std::this_thread::sleep_for(std::chrono::milliseconds(150));
    EXPECT_EQ(watched.frames(), before);
  }
  EXPECT_TRUE(watched.faults().empty());
}

TEST_F(VirtualDeviceTest, ADeviceThatComesLateIsFoundAndMissedOnlyOnce) {
  control("plugged 0");
  WatchedDevice watched(quick_config());
  watched.device.request(SensorStream::kDepth, true);
  std::this_thread::sleep_for(std::chrono::milliseconds(600));
  ASSERT_EQ(watched.faults().size(), 1U);
  EXPECT_THAT(watched.faults().front(), HasSubstr("'#1'"));
  EXPECT_THAT(watched.faults().front(), HasSubstr("no device is connected"));
  EXPECT_EQ(watched.device.status().state, DeviceState::kSearching);
  control("plugged 1");
  EXPECT_TRUE(watched.sends(3));
}

TEST_F(VirtualDeviceTest, ComesBackAfterEveryUnplugging) {
  WatchedDevice watched(quick_config());
  watched.device.request(SensorStream::kDepth, true);
  watched.device.request(SensorStream::kInfrared, true);
  for (int round = 0; round < 5; ++round) {
    ASSERT_TRUE(watched.sends(3)) << "round " << round;
    ASSERT_TRUE(watched.sends(3, SensorStream::kInfrared)) << "round " << round;
    control("plugged 0");
    ASSERT_TRUE(watched.reaches(DeviceState::kSearching)) << "round " << round;
    control("plugged 1");
  }
  ASSERT_TRUE(watched.sends(3));
  const auto status = watched.device.status();
  EXPECT_EQ(status.disconnections, 5);
  EXPECT_EQ(watched.faults().size(), 5U) << "one sentence a loss, not one an attempt";
  EXPECT_EQ(status.openings, 6);
  EXPECT_EQ(status.problem, "");
}

TEST_F(VirtualDeviceTest, StaysClosedAfterUnpluggingWhenToldTo) {
  OpenNIDeviceConfig config = quick_config();
  config.enable_reconnect = false;
  WatchedDevice watched(config);
  watched.device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(watched.sends(3));
  control("plugged 0");
  ASSERT_TRUE(watched.reaches(DeviceState::kEnded));
  control("plugged 1");
  EXPECT_FALSE(watched.sends(1, SensorStream::kDepth, 0.5));
  EXPECT_THAT(watched.device.status().problem, HasSubstr("enable_reconnect"));
}

TEST_F(VirtualDeviceTest, AStallIsToldOnceAndEndsWithTheNextFrame) {
  WatchedDevice watched(quick_config());
  watched.device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(watched.sends(3));
  control("streaming 0");
  ASSERT_TRUE(watched.reaches(DeviceState::kStalled));
  std::this_thread::sleep_for(std::chrono::milliseconds(1000));
  EXPECT_EQ(watched.faults().size(), 1U);
  EXPECT_THAT(watched.device.status().problem, HasSubstr("sent no frame for 0.4 s"));
  EXPECT_GE(watched.device.status().stalls, 2) << "it was not opened again";
  control("streaming 1");
  ASSERT_TRUE(watched.sends(3));
  EXPECT_EQ(watched.device.status().state, DeviceState::kStreaming);
  EXPECT_EQ(watched.device.status().problem, "");
}

TEST_F(VirtualDeviceTest, UnpluggedWhileStalledIsFoundAgain) {
  WatchedDevice watched(quick_config());
  watched.device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(watched.sends(3));
  control("streaming 0");
  ASSERT_TRUE(watched.reaches(DeviceState::kStalled));
  control("plugged 0");
  std::this_thread::sleep_for(std::chrono::milliseconds(700));
  control("plugged 1");
  EXPECT_TRUE(watched.sends(3));
}

TEST_F(VirtualDeviceTest, DevicesAreFoundByNumberSerialAndUri) {
  setenv("KINECT_NAV_VIRTUAL_DEVICES", "2", 1);
  OpenNIDeviceConfig config = quick_config();
  for (const std::string id : {"#2", "VIRTUAL0002", "kinect_nav_virtual/1"}) {
    config.device_id = id;
    WatchedDevice watched(config);
    ASSERT_TRUE(watched.reaches(DeviceState::kIdle)) << id;
    EXPECT_EQ(watched.device.status().serial, "VIRTUAL0002") << id;
  }
}

TEST_F(VirtualDeviceTest, AWrongIdIsNamedWithWhatIsConnected) {
  const std::pair<std::string, std::string> cases[] = {{"A00364A12345", "VIRTUAL0001"},
                                                       {"#7", "kinect_nav_virtual/0"},
                                                       {"#x", "'#1' is the first one"},
                                                       {"/nowhere/walk.oni", "absolute path"}};
  for (const auto& [id, told] : cases) {
    OpenNIDeviceConfig config = quick_config();
    config.device_id = id;
    WatchedDevice watched(config);
    ASSERT_TRUE(knav::wait_until([&] { return !watched.faults().empty(); })) << id;
    EXPECT_THAT(watched.faults().front(), HasSubstr(id));
    EXPECT_THAT(watched.faults().front(), HasSubstr(told));
  }
}

TEST_F(VirtualDeviceTest, TwoCamerasInOneProcessDoNotWaitForEachOther) {
  setenv("KINECT_NAV_VIRTUAL_DEVICES", "2", 1);
  WatchedDevice first(quick_config());
  OpenNIDeviceConfig config = quick_config();
  config.device_id = "#2";
  auto second = std::make_unique<WatchedDevice>(config);
  first.device.request(SensorStream::kDepth, true);
  second->device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(first.sends(5));
  ASSERT_TRUE(second->sends(5));
  second.reset();
  EXPECT_TRUE(first.sends(5));
}
