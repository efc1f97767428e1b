#include "kinect_sim/frame_thread.h"

#include <chrono>
#include <utility>

namespace knav {

FrameThread::FrameThread(FramePublisher& frames) : frames_(frames), thread_([this] { loop(); }) {}

FrameThread::~FrameThread() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  posted_.notify_all();
  thread_.join();
}

void FrameThread::post(FrameRequest& request) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (busy_) {
    ++dropped_;
    return;
  }
  std::swap(job_, request);
  busy_ = true;
  posted_.notify_one();
}

double FrameThread::render_ms() const {
  const std::uint64_t frames = rendered_;
  return frames > 0 ? 1e-6 * static_cast<double>(render_ns_) / static_cast<double>(frames) : 0.0;
}

void FrameThread::loop() {
  using Wall = std::chrono::steady_clock;
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    posted_.wait(lock, [&] { return stop_ || busy_; });
    if (stop_) return;
    lock.unlock();
    const Wall::time_point before = Wall::now();
    frames_.publish(job_);
    render_ns_ += std::chrono::duration_cast<std::chrono::nanoseconds>(Wall::now() - before).count();
    ++rendered_;
    lock.lock();
    busy_ = false;
  }
}

}  // namespace knav
