// OpenNI2's recorder and its stock file driver, with depth to 20 m.

#include <OpenNI.h>
#include <gmock/gmock.h>

#include "virtual_device_fixture.h"

using knav::DeviceState;
using knav::OpenNIDeviceConfig;
using knav::SensorStream;
using knav::VirtualDeviceTest;
using knav::WatchedDevice;
using testing::HasSubstr;

namespace {

/// Records until so many depth frames came, however slow the machine; returns their indices.
std::vector<int> record(const std::string& path, std::size_t frames) {
  std::vector<int> indices;
  auto runtime = knav::OpenNIRuntime::acquire();
  openni::Device device;
  // The plugin tells the runtime of its device from a thread of its own.
  if (!knav::wait_until([&] { return device.open(openni::ANY_DEVICE) == openni::STATUS_OK; })) {
    ADD_FAILURE() << openni::OpenNI::getExtendedError();
    return indices;
  }
  openni::VideoStream depth;
  EXPECT_EQ(depth.create(device, openni::SENSOR_DEPTH), openni::STATUS_OK);
  openni::Recorder recorder;
  EXPECT_EQ(recorder.create(path.c_str()), openni::STATUS_OK);
  EXPECT_EQ(recorder.attach(depth), openni::STATUS_OK);
  EXPECT_EQ(recorder.start(), openni::STATUS_OK);
  EXPECT_EQ(depth.start(), openni::STATUS_OK);
  const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (indices.size() < frames && std::chrono::steady_clock::now() < give_up) {
    openni::VideoStream* streams[] = {&depth};
    int ready = 0;
    if (openni::OpenNI::waitForAnyStream(streams, 1, &ready, 500) != openni::STATUS_OK) continue;
    openni::VideoFrameRef frame;
    depth.readFrame(&frame);
    indices.push_back(frame.getFrameIndex());
  }
  depth.stop();
  recorder.stop();
  recorder.destroy();
  depth.destroy();
  device.close();
  return indices;
}

int frame_shown(const WatchedDevice::Image& image) {
  return knav::room_frame_of_wall(image.pixels[240 * 640 + 320]);
}

class OniRecordingTest : public VirtualDeviceTest {
 protected:
  void SetUp() override {
    VirtualDeviceTest::SetUp();
    path_ = control_path_ + ".oni";
  }
  void TearDown() override {
    std::remove(path_.c_str());
    VirtualDeviceTest::TearDown();
  }
  std::string path_;
};

}  // namespace

TEST_F(OniRecordingTest, FramesComeBackExactly) {
  const std::vector<int> recorded = record(path_, 45);
  ASSERT_EQ(recorded.size(), 45U);
  OpenNIDeviceConfig config;
  config.device_id = path_;
  config.playback_repeat = false;
  WatchedDevice watched(config, true);
  watched.device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(watched.reaches(DeviceState::kEnded, 8.0)) << watched.device.status().problem;
  EXPECT_THAT(watched.device.status().problem, HasSubstr("at its end"));

  // A busy machine may miss frames at either end, but none comes wrong, twice or out of order.
  const auto images = watched.images();
  EXPECT_GE(images.size(), recorded.size() * 7 / 10);
  int farthest_mm = 0;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const int frame = frame_shown(images[i]);
    ASSERT_GE(frame, 0);
    EXPECT_EQ(knav::wrong_pixels(images[i].pixels, static_cast<uint64_t>(frame), {640, 480}), 0)
        << "frame " << frame;
    if (i > 0) {
      EXPECT_GE(frame - frame_shown(images[i - 1]), images[i].index - images[i - 1].index);
      EXPECT_GT(images[i].index, images[i - 1].index);
    }
    farthest_mm = std::max<int>(farthest_mm, knav::room_wall_mm(static_cast<uint64_t>(frame)));
  }
  EXPECT_GE(farthest_mm, 18000) << "the test should have seen all distances";
}

// The file driver's manual speed: nothing is missed, however slow the machine.
TEST_F(OniRecordingTest, EveryFrameOfTheFileIsRight) {
  record(path_, 30);
  auto runtime = knav::OpenNIRuntime::acquire();
  openni::Device device;
  ASSERT_EQ(device.open(path_.c_str()), openni::STATUS_OK) << openni::OpenNI::getExtendedError();
  ASSERT_EQ(device.getPlaybackControl()->setSpeed(-1.0F), openni::STATUS_OK);
  openni::VideoStream depth;
  ASSERT_EQ(depth.create(device, openni::SENSOR_DEPTH), openni::STATUS_OK);
  ASSERT_EQ(depth.start(), openni::STATUS_OK);
  const int count = device.getPlaybackControl()->getNumberOfFrames(depth);
  ASSERT_GE(count, 10);
  for (int i = 0; i < count; ++i) {
    openni::VideoStream* streams[] = {&depth};
    int ready = 0;
    ASSERT_EQ(openni::OpenNI::waitForAnyStream(streams, 1, &ready, 2000), openni::STATUS_OK) << "frame " << i;
    openni::VideoFrameRef frame;
    ASSERT_EQ(depth.readFrame(&frame), openni::STATUS_OK);
    const auto* data = static_cast<const uint16_t*>(frame.getData());
    const std::vector<uint16_t> pixels(data, data + 640 * 480);
    const int shown = knav::room_frame_of_wall(pixels[240 * 640 + 320]);
    ASSERT_GE(shown, 0) << "frame " << i;
    EXPECT_EQ(knav::wrong_pixels(pixels, static_cast<uint64_t>(shown), {640, 480}), 0) << "frame " << i;
  }
  depth.stop();
  depth.destroy();
  device.close();
}

TEST_F(OniRecordingTest, RepeatsUntilNobodyWantsIt) {
  record(path_, 15);
  OpenNIDeviceConfig config;
  config.device_id = path_;
  WatchedDevice watched(config, true);
  watched.device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(watched.sends(40, SensorStream::kDepth, 6.0)) << "a second has 30 frames, the recording fewer";
  EXPECT_EQ(watched.device.status().state, DeviceState::kStreaming);
  EXPECT_TRUE(watched.faults().empty());
}

TEST_F(OniRecordingTest, AFileThatIsNoRecordingIsRefusedByName) {
  std::ofstream(path_) << "this is not a recording\n";
  OpenNIDeviceConfig config;
  config.device_id = path_;
  WatchedDevice watched(config);
  ASSERT_TRUE(knav::wait_until([&] { return !watched.faults().empty(); }));
  EXPECT_THAT(watched.faults().front(), HasSubstr(path_));
}
