#include "openni2_driver/virtual_device/virtual_device.h"

#include <cmath>
#include <cstdio>

namespace knav {
namespace {

constexpr int64_t kDeviceZeroUs = 5000000;  // a device's clock starts anywhere

int64_t steady_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace

std::string virtual_serial(int index) {
  char text[32];
  std::snprintf(text, sizeof(text), "VIRTUAL%04d", index + 1);
  return text;
}

std::vector<OniVideoMode> virtual_modes(OniPixelFormat format) {
  return {{format, 640, 480, 30}, {format, 320, 240, 30}, {format, 320, 240, 60}};
}

VirtualStream::VirtualStream(OniSensorType type, std::shared_ptr<FrameSource> source,
                             std::shared_ptr<VirtualCable> cable)
    : PluginStream(
          type,
          virtual_modes(type == ONI_SENSOR_DEPTH ? ONI_PIXEL_FORMAT_DEPTH_1_MM : ONI_PIXEL_FORMAT_GRAY16),
          type == ONI_SENSOR_DEPTH ? 65535 : 1024),
      is_depth_(type == ONI_SENSOR_DEPTH),
      source_(std::move(source)),
      cable_(std::move(cable)) {}

VirtualStream::~VirtualStream() { stop(); }

OniStatus VirtualStream::start() {
  if (running_.exchange(true)) return ONI_STATUS_OK;
  thread_ = std::thread([this] { run(); });
  return ONI_STATUS_OK;
}

void VirtualStream::stop() {
  running_ = false;
  if (thread_.joinable()) thread_.join();
}

float VirtualStream::horizontal_fov_rad(const OniVideoMode& mode) const {
  const VirtualCamera camera{mode.resolutionX, mode.resolutionY};
  return static_cast<float>(2.0 * std::atan(0.5 * camera.width_px / camera.focal_px()));
}

float VirtualStream::vertical_fov_rad(const OniVideoMode& mode) const {
  const VirtualCamera camera{mode.resolutionX, mode.resolutionY};
  return static_cast<float>(2.0 * std::atan(0.5 * camera.height_px / camera.focal_px()));
}

void VirtualStream::run() {
  const VirtualCamera camera{mode().resolutionX, mode().resolutionY};
  const double period_us = 1e6 / mode().fps;
  int64_t done = -1;  // the newest frame sent
  int64_t plugged_at_us = cable_->plugged_at_us;
  while (running_) {
    if (plugged_at_us != cable_->plugged_at_us) {
      plugged_at_us = cable_->plugged_at_us;
      done = -1;
    }
    const int64_t now_us = steady_us();
    const auto due = static_cast<int64_t>(static_cast<double>(now_us - plugged_at_us) / period_us);
    if (due <= done || !cable_->plugged || !cable_->streaming) {
      const double next_us = static_cast<double>(plugged_at_us) + static_cast<double>(due + 1) * period_us;
      const auto pause_us = static_cast<int64_t>(next_us) - now_us + 1;
      std::this_thread::sleep_for(
          std::chrono::microseconds(std::min<int64_t>(std::max<int64_t>(pause_us, 100), 20000)));
      continue;
    }
    done = due;
    const auto frame_time_us =
        static_cast<uint64_t>(kDeviceZeroUs + std::llround(static_cast<double>(due) * period_us));
    OniFrame* frame = begin_frame(frame_time_us, static_cast<int>(due));
    if (frame == nullptr) continue;
    auto* pixels = static_cast<uint16_t*>(frame->data);
    if (is_depth_) {
      source_->render_depth(static_cast<uint64_t>(due), camera, pixels);
    } else {
      source_->render_ir(static_cast<uint64_t>(due), camera, pixels);
    }
    end_frame(frame);
  }
}

VirtualDevice::VirtualDevice(int index, std::shared_ptr<VirtualCable> cable)
    : PluginDevice(virtual_serial(index)), source_(make_frame_source(index)), cable_(std::move(cable)) {
  add_sensor(ONI_SENSOR_DEPTH, virtual_modes(ONI_PIXEL_FORMAT_DEPTH_1_MM));
  add_sensor(ONI_SENSOR_IR, virtual_modes(ONI_PIXEL_FORMAT_GRAY16));
}

oni::driver::StreamBase* VirtualDevice::createStream(OniSensorType type) {
  return has_sensor(type) ? new VirtualStream(type, source_, cable_) : nullptr;
}

void VirtualDevice::destroyStream(oni::driver::StreamBase* stream) { delete stream; }

}  // namespace knav
