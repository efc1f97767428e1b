#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace knav {

/// The memory in which a simulator shows its Kinect to the OpenNI2 driver plugin of any process of the same
/// user: a file /dev/shm/kinect_nav_camera.NAME with a short ring of frames for each stream. Nothing in it
/// can be left locked: whoever dies, the other notices by the stopped clock.
struct SharedCameraLayout;

enum class SharedStream { kDepth = 0, kInfrared = 1 };
constexpr int kSharedStreamCount = 2;

/// What does not change while the camera exists.
struct SharedCameraInfo {
  std::string serial;
  int width_px = 640;
  int height_px = 480;
  double focal_px = 585.0;
  double rate_hz = 30.0;
};

/// The simulator's end. All calls but keep_alive() and set_...() from one thread.
class SharedCameraWriter {
 public:
  /// UserError if a living simulator shows a camera of this name, or the memory cannot be had.
  SharedCameraWriter(const std::string& name, const SharedCameraInfo& info);
  ~SharedCameraWriter();
  SharedCameraWriter(const SharedCameraWriter&) = delete;
  SharedCameraWriter& operator=(const SharedCameraWriter&) = delete;

  /// To be called at least every kSharedCameraTimeoutS / 4; a camera whose writer is silent counts as
  /// unplugged.
  void keep_alive();
  /// Whether any reader wants frames of this stream now.
  bool wanted(SharedStream stream) const;
  /// The pixels of the next frame, to be filled in; width_px * height_px values.
  uint16_t* begin_frame(SharedStream stream);
  void end_frame(SharedStream stream, uint64_t time_us, int index);
  /// The cable, pulled and plugged.
  void set_plugged(bool plugged);
  /// false: begin_frame() and end_frame() are as ever, but no frame reaches a reader.
  void set_streaming(bool streaming);

 private:
  std::string path_;
  SharedCameraInfo info_;
  SharedCameraLayout* layout_ = nullptr;
  std::size_t bytes_ = 0;
  std::atomic<bool> streaming_{true};
};

/// A driver's end.
class SharedCameraReader {
 public:
  /// Null if there is no such camera, or it is unplugged or dead.
  static std::shared_ptr<SharedCameraReader> open(const std::string& name);
  ~SharedCameraReader();
  SharedCameraReader(const SharedCameraReader&) = delete;
  SharedCameraReader& operator=(const SharedCameraReader&) = delete;

  const SharedCameraInfo& info() const { return info_; }
  bool plugged() const;
  /// Says that frames of this stream are wanted for the next second.
  void want(SharedStream stream);
  /// Number of the newest frame; 0 before the first.
  uint32_t newest(SharedStream stream) const;
  /// Waits until there is one newer than `seen`, for 20 ms at most.
  void wait_newer(SharedStream stream, uint32_t seen) const;
  struct Stamp {
    uint64_t time_us = 0;
    int index = 0;
  };
  /// Copies frame `number`; false if the writer was faster.
  bool copy(SharedStream stream, uint32_t number, uint16_t* out, Stamp* stamp) const;

 private:
  SharedCameraReader() = default;
  SharedCameraInfo info_;
  SharedCameraLayout* layout_ = nullptr;
  std::size_t bytes_ = 0;
};

/// Names of the cameras there are, the unplugged and the dead included.
std::vector<std::string> shared_camera_names();

constexpr double kSharedCameraTimeoutS = 2.0;

}  // namespace knav
