#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>

#include "kinect_sim/frame_publisher.h"

namespace knav {

/// Renders and publishes frames in a thread of its own, for a simulator in real time: a frame that comes while the one
/// before is still being rendered is dropped and counted.
class FrameThread {
 public:
  explicit FrameThread(FramePublisher& frames);
  ~FrameThread();

  /// Takes the request if there is time for it. post() and dropped() belong to one thread.
  void post(FrameRequest& request);

  std::uint64_t dropped() const { return dropped_; }
  std::uint64_t rendered() const { return rendered_; }
  /// Mean, on the wall.
  double render_ms() const;

 private:
  void loop();

  FramePublisher& frames_;
  std::mutex mutex_;  ///< job_, busy_ and stop_
  std::condition_variable posted_;
  FrameRequest job_;
  bool busy_ = false, stop_ = false;
  std::uint64_t dropped_ = 0;
  std::atomic<std::uint64_t> rendered_{0};
  std::atomic<std::int64_t> render_ns_{0};
  std::thread thread_;
};

}  // namespace knav
