// The device a simulator shows, through the real OpenNI2 runtime. The test plays the simulator.

#include <gmock/gmock.h>
#include <sys/prctl.h>
#include <sys/wait.h>

#include <atomic>
#include <cmath>

#include "core/error.h"
#include "openni2_driver/driver_gate.h"
#include "openni2_driver/simulated_device/shared_camera.h"
#include "virtual_device_fixture.h"

using knav::DeviceState;
using knav::OpenNIDeviceConfig;
using knav::SensorStream;
using knav::SharedCameraInfo;
using knav::SharedCameraWriter;
using knav::SharedStream;
using knav::WatchedDevice;
using testing::HasSubstr;

namespace {

std::string camera_name(const char* what = "a") { return "test_" + std::to_string(getpid()) + "_" + what; }

SharedCameraInfo info_of() {
  SharedCameraInfo info;
  info.serial = "SIM42";
  return info;
}

/// A simulator that shows the room whose every pixel has a formula.
class ShownRoom {
 public:
  explicit ShownRoom(const std::string& name = camera_name())
      : writer(name, info_of()), thread_([this] { run(); }) {}
  ~ShownRoom() {
    stop_ = true;
    thread_.join();
  }
  SharedCameraWriter writer;
  std::atomic<int> rendered[2] = {};

 private:
  void run() {
    knav::AnalyticRoom room;
    for (int frame = 0; !stop_; ++frame) {
      writer.keep_alive();
      for (const SharedStream stream : {SharedStream::kDepth, SharedStream::kInfrared}) {
        if (!writer.wanted(stream)) continue;
        ++rendered[static_cast<int>(stream)];
        uint16_t* pixels = writer.begin_frame(stream);
        if (stream == SharedStream::kDepth) {
          room.render_depth(static_cast<uint64_t>(frame), {640, 480}, pixels);
        } else {
          room.render_ir(static_cast<uint64_t>(frame), {640, 480}, pixels);
        }
        writer.end_frame(stream, 7000000U + static_cast<uint64_t>(frame) * 10000U, frame);
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

OpenNIDeviceConfig config_of(const std::string& name = camera_name()) {
  OpenNIDeviceConfig config;
  config.device_id = "kinect_nav_simulated/" + name;
  config.reconnect_period_s = 0.1;
  config.stall_timeout_s = 0.4;
  return config;
}

}  // namespace

TEST(SimulatedDevice, DepthAndInfraredArriveExactlyWithTheSimulatorsTime) {
  ShownRoom room;
  WatchedDevice watched(config_of(), true);
  watched.device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(watched.sends(15)) << watched.device.status().problem;
  EXPECT_EQ(room.rendered[1], 0) << "IR was rendered for nobody";
  watched.device.request(SensorStream::kInfrared, true);
  ASSERT_TRUE(watched.sends(10, SensorStream::kInfrared));
  EXPECT_EQ(watched.device.status().serial, "SIM42");
  for (const auto& image : watched.images()) {
    EXPECT_EQ(image.device_time_us, 7000000U + static_cast<uint64_t>(image.index) * 10000U);
    EXPECT_NEAR(320.0 / std::tan(0.5 * image.horizontal_fov_rad), 585.0, 1e-3);
    const auto frame = static_cast<uint64_t>(image.index);
    if (image.stream == SensorStream::kDepth) {
      EXPECT_EQ(knav::wrong_pixels(image.pixels, frame, {640, 480}), 0);
      continue;
    }
    int wrong = 0;
    for (int i = 0; i < 640 * 480; ++i) {
      wrong += image.pixels[static_cast<std::size_t>(i)] != knav::room_ir(i % 640, i / 640, frame) ? 1 : 0;
    }
    EXPECT_EQ(wrong, 0);
  }
}

TEST(SimulatedDevice, ComesBackAfterUnpluggingStallAndALateStart) {
  WatchedDevice watched(config_of());
  watched.device.request(SensorStream::kDepth, true);
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_EQ(watched.device.status().state, DeviceState::kSearching);
  EXPECT_GE(watched.device.status().waited_s, 0.25);
  ShownRoom room;
  ASSERT_TRUE(watched.sends(3)) << "late start";
  room.writer.set_plugged(false);
  ASSERT_TRUE(watched.reaches(DeviceState::kSearching));
  EXPECT_THAT(watched.device.status().problem, HasSubstr("was unplugged"));
  room.writer.set_plugged(true);
  ASSERT_TRUE(watched.sends(3)) << "replug";
  EXPECT_EQ(watched.device.status().recoveries, 1);
  EXPECT_THAT(watched.device.status().last_event, HasSubstr("after it was lost"));
  room.writer.set_streaming(false);
  ASSERT_TRUE(watched.reaches(DeviceState::kStalled));
  room.writer.set_streaming(true);
  ASSERT_TRUE(watched.sends(3)) << "stall";
  EXPECT_EQ(watched.device.status().recoveries, 2);
  EXPECT_EQ(watched.device.status().disconnections, 1);
  EXPECT_GT(watched.device.status().last_outage_s, 0.0);
}

TEST(SimulatedDevice, ASimulatorThatEndsAndStartsAnewIsAReplugging) {
  WatchedDevice watched(config_of());
  watched.device.request(SensorStream::kDepth, true);
  for (int round = 0; round < 2; ++round) {
    ShownRoom room;
    ASSERT_TRUE(watched.sends(3)) << round;
  }
  EXPECT_TRUE(watched.reaches(DeviceState::kSearching));
  EXPECT_EQ(watched.device.status().disconnections, 2);
}

TEST(SimulatedDevice, AKilledSimulatorCountsAsUnpluggedAndItsNameIsFree) {
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  const std::string name = camera_name("killed");
  const pid_t child = fork();
  if (child == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);  // it never outlives the test
    SharedCameraWriter writer(name, info_of());
    const char told = 1;
    if (write(ready[1], &told, 1) != 1) _exit(1);
    while (true) {
      writer.keep_alive();
      usleep(10000);
    }
  }
  ASSERT_GT(child, 0);
  close(ready[1]);  // so that reading ends should the child end
  char told = 0;
  ASSERT_EQ(read(ready[0], &told, 1), 1) << "the child could not show a camera";
  EXPECT_THROW(SharedCameraWriter(name, info_of()), knav::UserError) << "two simulators show one device";
  WatchedDevice watched(config_of(name));
  ASSERT_TRUE(watched.reaches(DeviceState::kIdle));
  kill(child, SIGKILL);
  int state = 0;
  waitpid(child, &state, 0);
  EXPECT_TRUE(watched.reaches(DeviceState::kSearching, 5.0)) << "a dead simulator's device is still there";
  EXPECT_NO_THROW(SharedCameraWriter(name, info_of()));
  close(ready[0]);
}

TEST(SimulatedDevice, ReconfiguringTakesEffectWhileItRuns) {
  ShownRoom room;
  WatchedDevice watched(config_of());
  watched.device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(watched.sends(3));
  OpenNIDeviceConfig config = config_of();
  config.width_px = 320;
  config.height_px = 240;
  watched.device.configure(config);
  ASSERT_TRUE(knav::wait_until([&] { return !watched.device.status().problem.empty(); }));
  EXPECT_THAT(watched.device.status().problem, HasSubstr("320x240@30"));
  EXPECT_THAT(watched.device.status().problem, HasSubstr("640x480@30"));
  config = config_of();
  config.enable_reconnect = false;
  watched.device.configure(config);
  ASSERT_TRUE(watched.sends(3)) << "the mode it had before";
  EXPECT_EQ(watched.device.status().problem, "");
  room.writer.set_plugged(false);
  ASSERT_TRUE(watched.reaches(DeviceState::kEnded));
  room.writer.set_plugged(true);
  EXPECT_FALSE(watched.sends(1, SensorStream::kDepth, 0.4));
  config.enable_reconnect = true;
  watched.device.configure(config);
  EXPECT_TRUE(watched.sends(3)) << "it should search again";
}

TEST(SimulatedDevice, IsNeverTakenForTheFirstDevice) {
  ShownRoom room;
  OpenNIDeviceConfig config = config_of();
  config.device_id = "#1";
  WatchedDevice watched(config);
  watched.device.request(SensorStream::kDepth, true);
  ASSERT_TRUE(knav::wait_until([&] { return !watched.faults().empty(); }));
  EXPECT_THAT(watched.faults().front(), HasSubstr("kinect_nav_simulated/" + camera_name()));
  EXPECT_EQ(watched.frames(), 0);
}

TEST(SharedCamera, ANameThatIsAPathIsRefused) {
  EXPECT_THROW(SharedCameraWriter("../evil", info_of()), knav::UserError);
  EXPECT_THROW(SharedCameraWriter("", info_of()), knav::UserError);
}

TEST(DriverGate, ClosingItWaitsForNewsUnderWayAndStopsWhatComesAfter) {
  // The runtime's shutdown waits for a plugin's threads with a lock held that their news would take.
  knav::DriverGate::open();
  std::atomic<bool> telling{false}, told{false};
  std::thread watcher([&] {
    knav::DriverGate::tell([&] {
      telling = true;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      told = true;
    });
  });
  while (!telling) std::this_thread::yield();
  kinect_nav_driver_rest();
  EXPECT_TRUE(told);
  watcher.join();
  bool late = false;
  knav::DriverGate::tell([&] { late = true; });
  EXPECT_FALSE(late);
  knav::DriverGate::open();
  knav::DriverGate::tell([&] { late = true; });
  EXPECT_TRUE(late);
}
