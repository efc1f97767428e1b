#include "openni2_driver/kinect_v1/freenect_loop.h"

#include <libfreenect_registration.h>

#include <algorithm>
#include <chrono>

// Debian's fakenect, the recorded Kinect of libfreenect, lacks these.
#pragma weak freenect_list_device_attributes
#pragma weak freenect_free_device_attributes
#pragma weak freenect_copy_registration
#pragma weak freenect_destroy_registration

namespace knav {
namespace {

constexpr int kEventTimeoutUs = 20000;
constexpr std::chrono::milliseconds kLookPeriod(1000);

KinectFrames* frames_of(freenect_device* device) {
  return static_cast<KinectFrames*>(freenect_get_user(device));
}

void depth_callback(freenect_device* device, void* depth, uint32_t ticks) {
  frames_of(device)->on_depth(static_cast<const uint16_t*>(depth), ticks);
}
void video_callback(freenect_device* device, void* video, uint32_t ticks) {
  frames_of(device)->on_ir(static_cast<const uint16_t*>(video), ticks);
}

/// Searched rather than asked for: fakenect ends the process when asked for a mode it has not.
freenect_frame_mode ir_mode() {
  for (int i = 0; i < freenect_get_video_mode_count(); ++i) {
    const freenect_frame_mode mode = freenect_get_video_mode(i);
    if (mode.is_valid != 0 && mode.video_format == FREENECT_VIDEO_IR_10BIT && mode.width == 640 &&
        mode.height >= 480) {
      return mode;
    }
  }
  return freenect_frame_mode{};
}

std::vector<KinectOnUsb> list_kinects(freenect_context* context) {
  std::vector<KinectOnUsb> list;
  const auto add = [&](std::string serial) {
    if (serial.find_first_not_of('0') == std::string::npos) serial.clear();
    KinectOnUsb kinect;
    kinect.index = static_cast<int>(list.size());
    kinect.serial = serial;
    kinect.uri = "kinect_v1/" + (serial.empty() ? "#" + std::to_string(kinect.index + 1) : serial);
    list.push_back(kinect);
  };
  if (freenect_list_device_attributes != nullptr && freenect_free_device_attributes != nullptr) {
    freenect_device_attributes* attributes = nullptr;
    if (freenect_list_device_attributes(context, &attributes) < 0) return list;
    for (auto* a = attributes; a != nullptr; a = a->next)
      add(a->camera_serial == nullptr ? "" : a->camera_serial);
    freenect_free_device_attributes(attributes);
  } else {
    for (int i = 0; i < freenect_num_devices(context); ++i) add("");
  }
  return list;
}

}  // namespace

FreenectLoop::FreenectLoop(std::function<void(const KinectOnUsb&, bool)> on_change)
    : on_change_(std::move(on_change)), thread_([this] { run(); }) {
  // Whoever opens OpenNI2 expects the devices that are there to be listed at once.
  in_loop([] {});
}

FreenectLoop::~FreenectLoop() {
  {
    std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

void FreenectLoop::in_loop(const std::function<void()>& task) {
  if (std::this_thread::get_id() == thread_.get_id()) {
    task();
    return;
  }
  std::lock_guard<std::mutex> caller(callers_);
  std::unique_lock<std::mutex> lock(mutex_);
  task_ = &task;
  wake_.notify_all();
  done_.wait(lock, [this] { return task_ == nullptr; });
}

void FreenectLoop::run() {
  auto next_look = std::chrono::steady_clock::now();
  int count = -1;
  while (true) {
    if (context_ == nullptr) {
      if (freenect_init(&context_, nullptr) < 0) {
        context_ = nullptr;
      } else {
        freenect_set_log_level(context_, FREENECT_LOG_ERROR);
        // The motor and the microphones need firmware and power that the camera does not.
        freenect_select_subdevices(context_, FREENECT_DEVICE_CAMERA);
      }
    }
    if (context_ != nullptr && std::chrono::steady_clock::now() >= next_look) {
      next_look = std::chrono::steady_clock::now() + kLookPeriod;
      // Reading serial numbers opens every Kinect, so while one streams that is done only when their number
      // changed.
      const int now = freenect_num_devices(context_);
      if (open_.empty() || now != count) look_for_kinects();
      count = now;
    }
    {
      std::unique_lock<std::mutex> lock(mutex_);
      if (open_.empty() || context_ == nullptr) {
        wake_.wait_for(lock, std::chrono::milliseconds(100), [this] { return stop_ || task_ != nullptr; });
      }
      if (stop_) break;
      if (task_ != nullptr) {
        const std::function<void()>& task = *task_;
        lock.unlock();
        task();
        lock.lock();
        task_ = nullptr;
        done_.notify_all();
      }
    }
    if (!open_.empty()) {
      timeval timeout{0, kEventTimeoutUs};
      if (freenect_process_events_timeout(context_, &timeout) < 0) {
        lose_open_kinects();
        next_look = std::chrono::steady_clock::now() + kLookPeriod;
      }
    }
  }
  for (const auto& [device, kinect] : open_) freenect_close_device(device);
  if (context_ != nullptr) freenect_shutdown(context_);
}

void FreenectLoop::look_for_kinects() {
  const std::vector<KinectOnUsb> now = list_kinects(context_);
  std::vector<KinectOnUsb> before;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    before = kinects_;
    kinects_ = now;
  }
  const auto holds = [](const std::vector<KinectOnUsb>& list, const std::string& uri) {
    return std::any_of(list.begin(), list.end(), [&](const KinectOnUsb& k) { return k.uri == uri; });
  };
  for (const KinectOnUsb& kinect : before) {
    if (!holds(now, kinect.uri)) on_change_(kinect, false);
  }
  for (const KinectOnUsb& kinect : now) {
    if (!holds(before, kinect.uri)) on_change_(kinect, true);
  }
}

// libfreenect does not say whose events failed: with several open, the healthy ones are opened again too.
void FreenectLoop::lose_open_kinects() {
  std::vector<KinectOnUsb> lost;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    for (const auto& [device, kinect] : open_) {
      const std::string& uri = kinect.uri;
      const auto at =
          std::find_if(kinects_.begin(), kinects_.end(), [&](const KinectOnUsb& k) { return k.uri == uri; });
      if (at == kinects_.end()) continue;  // told before
      lost.push_back(*at);
      kinects_.erase(at);
    }
  }
  for (const KinectOnUsb& kinect : lost) on_change_(kinect, false);
  // Their owner closes them; until then they are not pumped in a tight loop.
  std::this_thread::sleep_for(std::chrono::milliseconds(10));
}

freenect_device* FreenectLoop::open(const KinectOnUsb& kinect, KinectFrames* frames) {
  freenect_device* device = nullptr;
  in_loop([&] {
    if (context_ == nullptr) return;
    const int result = kinect.serial.empty()
                           ? freenect_open_device(context_, &device, kinect.index)
                           : freenect_open_device_by_camera_serial(context_, &device, kinect.serial.c_str());
    if (result < 0) {
      device = nullptr;
      return;
    }
    freenect_set_user(device, frames);
    freenect_set_depth_callback(device, depth_callback);
    freenect_set_video_callback(device, video_callback);
    open_.emplace_back(device, kinect);
  });
  return device;
}

void FreenectLoop::close(freenect_device* device) {
  in_loop([&] {
    freenect_close_device(device);
    open_.erase(
        std::remove_if(open_.begin(), open_.end(), [&](const auto& entry) { return entry.first == device; }),
        open_.end());
  });
}

bool FreenectLoop::start_depth(freenect_device* device) {
  bool started = false;
  in_loop([&] {
    const freenect_frame_mode mode =
        freenect_find_depth_mode(FREENECT_RESOLUTION_MEDIUM, FREENECT_DEPTH_11BIT);
    started = freenect_set_depth_mode(device, mode) >= 0 && freenect_start_depth(device) >= 0;
  });
  return started;
}

bool FreenectLoop::start_ir(freenect_device* device) {
  bool started = false;
  in_loop([&] {
    const freenect_frame_mode mode = ir_mode();
    started =
        mode.is_valid != 0 && freenect_set_video_mode(device, mode) >= 0 && freenect_start_video(device) >= 0;
  });
  return started;
}

void FreenectLoop::stop_depth(freenect_device* device) {
  in_loop([&] { freenect_stop_depth(device); });
}
void FreenectLoop::stop_ir(freenect_device* device) {
  in_loop([&] { freenect_stop_video(device); });
}

bool FreenectLoop::has_ir() const { return ir_mode().is_valid != 0; }

ZeroPlane FreenectLoop::zero_plane(freenect_device* device) {
  ZeroPlane plane;
  if (freenect_copy_registration == nullptr || freenect_destroy_registration == nullptr) return plane;
  in_loop([&] {
    freenect_registration registration = freenect_copy_registration(device);
    const freenect_zero_plane_info& told = registration.zero_plane_info;
    // A device that could not be asked tells zeros.
    if (told.dcmos_emitter_dist > 1.0F && told.reference_distance > 10.0F &&
        told.reference_pixel_size > 0.01F && registration.const_shift > 0.0) {
      plane.emitter_distance_cm = static_cast<double>(told.dcmos_emitter_dist);
      plane.reference_distance_cm = static_cast<double>(told.reference_distance);
      plane.pixel_size_cm = static_cast<double>(told.reference_pixel_size);
      plane.const_shift = registration.const_shift;
    }
    freenect_destroy_registration(&registration);
  });
  return plane;
}

std::vector<KinectOnUsb> FreenectLoop::kinects() {
  std::lock_guard<std::mutex> lock(mutex_);
  return kinects_;
}

}  // namespace knav
