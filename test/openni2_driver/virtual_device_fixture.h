#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "openni2_driver/openni_device.h"
#include "openni2_driver/virtual_device/analytic_room.h"

namespace knav {

/// Virtual devices whose cable the test holds.
class VirtualDeviceTest : public ::testing::Test {
 protected:
  void SetUp() override {
    control_path_ = ::testing::TempDir() + "kinect_nav_virtual_" + std::to_string(getpid());
    setenv("KINECT_NAV_VIRTUAL_CONTROL", control_path_.c_str(), 1);
    setenv("KINECT_NAV_VIRTUAL_DEVICES", "1", 1);
    control("plugged 1");
  }
  void TearDown() override { std::remove(control_path_.c_str()); }

  void control(const std::string& text) {
    const std::string part = control_path_ + ".part";
    std::ofstream(part) << text << "\n";
    std::rename(part.c_str(), control_path_.c_str());
  }

  std::string control_path_;
};

/// Waits for a condition; false if it does not come true in time.
inline bool wait_until(const std::function<bool()>& condition, double timeout_s = 4.0) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout_s);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

/// A device, and what it said and sent.
class WatchedDevice {
 public:
  struct Image {
    SensorStream stream;
    int index, width_px, height_px;
    uint64_t device_time_us;
    double horizontal_fov_rad;
    std::vector<uint16_t> pixels;
  };

  explicit WatchedDevice(const OpenNIDeviceConfig& config, bool keep_images = false)
      : keep_images_(keep_images),
        device(
            config, [this](const SensorFrame& frame) { take(frame); },
            [this](bool fault, const std::string& sentence) {
              std::lock_guard<std::mutex> lock(mutex_);
              (fault ? faults_ : news_).push_back(sentence);
            }) {}

  int frames(SensorStream stream = SensorStream::kDepth) const {
    std::lock_guard<std::mutex> lock(mutex_);
    return frames_[static_cast<int>(stream)];
  }
  std::vector<std::string> faults() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return faults_;
  }
  std::vector<Image> images() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return images_;
  }
  bool reaches(DeviceState state, double timeout_s = 4.0) const {
    return wait_until([&] { return device.status().state == state; }, timeout_s);
  }
  bool sends(int more, SensorStream stream = SensorStream::kDepth, double timeout_s = 4.0) const {
    const int before = frames(stream);
    return wait_until([&] { return frames(stream) >= before + more; }, timeout_s);
  }

 private:
  void take(const SensorFrame& frame) {
    Image image{frame.stream,
                frame.index,
                frame.width_px,
                frame.height_px,
                frame.device_time_us,
                frame.horizontal_fov_rad,
                {}};
    if (keep_images_) {
      image.pixels.resize(static_cast<std::size_t>(frame.width_px * frame.height_px));
      copy_pixels(frame, image.pixels.data());
    }
    std::lock_guard<std::mutex> lock(mutex_);
    ++frames_[static_cast<int>(frame.stream)];
    if (keep_images_) images_.push_back(std::move(image));
  }

  mutable std::mutex mutex_;
  bool keep_images_;
  int frames_[kSensorStreamCount] = {0, 0};
  std::vector<std::string> faults_, news_;
  std::vector<Image> images_;

 public:
  OpenNIDevice device;  // last: its thread uses the above
};

/// How many pixels differ from the analytic room's.
inline int wrong_pixels(const std::vector<uint16_t>& pixels, uint64_t frame, const VirtualCamera& camera) {
  std::vector<uint16_t> expected(pixels.size());
  AnalyticRoom().render_depth(frame, camera, expected.data());
  int wrong = 0;
  for (std::size_t i = 0; i < pixels.size(); ++i) wrong += pixels[i] != expected[i] ? 1 : 0;
  return wrong;
}

}  // namespace knav
