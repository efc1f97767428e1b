#pragma once

#include <libfreenect.h>

#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "openni2_driver/kinect_v1/disparity.h"

namespace knav {

/// A Kinect on the USB.
struct KinectOnUsb {
  std::string uri;
  std::string serial;  ///< "" if it tells none (Kinect for Windows tells only zeros)
  int index = 0;
};

/// Frames of an open Kinect, called from the loop's thread.
class KinectFrames {
 public:
  virtual ~KinectFrames() = default;
  virtual void on_depth(const uint16_t* codes, uint32_t ticks) = 0;
  virtual void on_ir(const uint16_t* pixels, uint32_t ticks) = 0;
};

/// Owns libfreenect, which may be used from one thread only: looks for Kinects once a second, pumps the USB
/// events of the open ones, and notices when one is gone.
class FreenectLoop {
 public:
  /// @param on_change called from the loop's thread when a Kinect comes (true) or goes
  explicit FreenectLoop(std::function<void(const KinectOnUsb&, bool)> on_change);
  ~FreenectLoop();

  /// Null if it cannot be opened; `frames` must outlive close().
  freenect_device* open(const KinectOnUsb& kinect, KinectFrames* frames);
  void close(freenect_device* device);
  bool start_depth(freenect_device* device);
  bool start_ir(freenect_device* device);
  void stop_depth(freenect_device* device);
  void stop_ir(freenect_device* device);
  /// libfreenect's fakenect plays no IR.
  bool has_ir() const;
  ZeroPlane zero_plane(freenect_device* device);
  /// What is on the USB now, as far as the last look told.
  std::vector<KinectOnUsb> kinects();

 private:
  void run();
  /// Runs a task in the loop's thread and waits for it.
  void in_loop(const std::function<void()>& task);
  void look_for_kinects();
  void lose_open_kinects();

  std::function<void(const KinectOnUsb&, bool)> on_change_;
  std::mutex mutex_;  // guards the four below
  std::condition_variable wake_, done_;
  bool stop_ = false;
  const std::function<void()>* task_ = nullptr;
  std::vector<KinectOnUsb> kinects_;

  std::mutex callers_;  // one task at a time
  freenect_context* context_ = nullptr;
  std::vector<std::pair<freenect_device*, KinectOnUsb>> open_;  // of the loop's thread
  std::thread thread_;
};

}  // namespace knav
