// The Kinect v1 plugin in the real runtime, over a libfreenect with serial numbers, IR and a USB that the
// test holds (scripted_freenect.cpp); fakenect has none of these. Run by ctest, which puts the folders on
// LD_LIBRARY_PATH.

#include <gmock/gmock.h>

#include <cmath>

#include "scripted_kinect.h"
#include "virtual_device_fixture.h"

using knav::DeviceState;
using knav::OpenNIDeviceConfig;
using knav::SensorStream;
using knav::WatchedDevice;
using testing::HasSubstr;
namespace scripted = knav::scripted;

namespace {

constexpr char kFirst[] = "A00364A11111011A", kSecond[] = "A00366B22222022B";

class KinectV1UsbTest : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ = ::testing::TempDir() + "kinect_nav_usb_" + std::to_string(getpid());
    setenv("KINECT_NAV_SCRIPTED_KINECTS", path_.c_str(), 1);
    usb(kFirst);
  }
  void TearDown() override { std::remove(path_.c_str()); }
  /// These, and no others, are on the USB now.
  void usb(const std::string& serials) const {
    const std::string part = path_ + ".part";
    std::ofstream(part) << serials << "\n";
    std::rename(part.c_str(), path_.c_str());
  }
  std::string path_;
};

OpenNIDeviceConfig config_of(const std::string& id) {
  OpenNIDeviceConfig config;
  config.device_id = id;
  config.reconnect_period_s = 0.1;
  return config;
}

}  // namespace

TEST_F(KinectV1UsbTest, DepthFollowsTheDevicesOwnZeroPlane) {
  WatchedDevice watched(config_of("#1"), true);
  watched.device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(watched.sends(5)) << watched.device.status().problem;
  EXPECT_EQ(watched.device.status().serial, kFirst);
  const auto image = watched.images().back();
  // Frames repeat after 50; the one that fits must fit in every pixel.
  int fewest_wrong = 1 << 30, too_near_or_far = 0, far_pixels = 0;
  for (unsigned frame = 0; frame < 50; ++frame) {
    int wrong = 0;
    for (int i = 0; i < scripted::kWidth * scripted::kHeight; ++i) {
      const uint16_t code = scripted::code(i % scripted::kWidth, i / scripted::kWidth, frame);
      // The formula itself, not the plugin's table.
      const double mm = code == 2047 ? -1.0 : knav::depth_of_code_mm(code, scripted::zero_plane());
      const int expected = mm >= 400.0 && mm <= 26000.0 ? static_cast<int>(std::lround(mm)) : 0;
      wrong += image.pixels[static_cast<std::size_t>(i)] != expected ? 1 : 0;
    }
    fewest_wrong = std::min(fewest_wrong, wrong);
  }
  for (const uint16_t mm : image.pixels) {
    too_near_or_far += mm != 0 && (mm < 400 || mm > 26000) ? 1 : 0;
    far_pixels += mm > 20000 ? 1 : 0;
  }
  EXPECT_EQ(fewest_wrong, 0);
  EXPECT_EQ(too_near_or_far, 0) << "an implausible code came through";
  EXPECT_GT(far_pixels, 0) << "nothing beyond 20 m";
  EXPECT_NEAR(320.0 / std::tan(0.5 * image.horizontal_fov_rad), 118.5 / (2.0 * 0.1049), 0.05);
}

TEST_F(KinectV1UsbTest, InfraredIsTheUpper480RowsBesideDepth) {
  WatchedDevice watched(config_of(kFirst), true);
  watched.device.request(SensorStream::kInfrared, true);
  watched.device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(watched.sends(5, SensorStream::kInfrared)) << watched.device.status().problem;
  ASSERT_TRUE(watched.sends(5, SensorStream::kDepth));
  int checked = 0;
  for (const auto& image : watched.images()) {
    if (image.stream != SensorStream::kInfrared) continue;
    ASSERT_EQ(image.width_px, 640);
    ASSERT_EQ(image.height_px, 480);
    const unsigned frame = image.pixels[0];
    int wrong = 0;
    for (int i = 0; i < 640 * 480; ++i) {
      wrong +=
          image.pixels[static_cast<std::size_t>(i)] != scripted::infrared(i % 640, i / 640, frame) ? 1 : 0;
    }
    EXPECT_EQ(wrong, 0);
    ++checked;
  }
  EXPECT_GE(checked, 5);
}

TEST_F(KinectV1UsbTest, OneOfTwoIsFoundByItsSerialNumber) {
  usb(std::string(kFirst) + "\n" + kSecond);
  WatchedDevice watched(config_of(kSecond));
  ASSERT_TRUE(watched.reaches(DeviceState::kIdle, 5.0));
  EXPECT_EQ(watched.device.status().serial, kSecond);
  EXPECT_EQ(watched.device.status().uri, std::string("kinect_v1/") + kSecond);
}

TEST_F(KinectV1UsbTest, UnpluggedAndPluggedInItStreamsAgain) {
  WatchedDevice watched(config_of(kFirst));
  watched.device.request(SensorStream::kDepth, true);
  watched.device.request(SensorStream::kInfrared, true);
  for (int round = 0; round < 2; ++round) {
    ASSERT_TRUE(watched.sends(3)) << "round " << round;
    ASSERT_TRUE(watched.sends(3, SensorStream::kInfrared)) << "round " << round;
    usb("");
    ASSERT_TRUE(watched.reaches(DeviceState::kSearching)) << "round " << round;
    EXPECT_THAT(watched.device.status().problem, HasSubstr("was unplugged"));
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    usb(kFirst);
  }
  ASSERT_TRUE(watched.sends(3));
  EXPECT_EQ(watched.device.status().disconnections, 2);
  EXPECT_EQ(watched.device.status().recoveries, 2);
}

TEST_F(KinectV1UsbTest, AKinectThatComesLateIsFound) {
  usb("");
  WatchedDevice watched(config_of("#1"));
  watched.device.request(SensorStream::kDepth, true);
  std::this_thread::sleep_for(std::chrono::milliseconds(400));
  EXPECT_EQ(watched.device.status().state, DeviceState::kSearching);
  usb(kFirst);
  EXPECT_TRUE(watched.sends(3));
}
