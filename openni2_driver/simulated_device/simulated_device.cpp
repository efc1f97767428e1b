#include "openni2_driver/simulated_device/simulated_device.h"

#include <cmath>

namespace knav {
namespace {

std::vector<OniVideoMode> modes_of(OniSensorType type, const SharedCameraInfo& info) {
  return {{type == ONI_SENSOR_DEPTH ? ONI_PIXEL_FORMAT_DEPTH_1_MM : ONI_PIXEL_FORMAT_GRAY16, info.width_px,
           info.height_px, static_cast<int>(std::lround(info.rate_hz))}};
}

}  // namespace

SimulatedStream::SimulatedStream(OniSensorType type, std::shared_ptr<SharedCameraReader> camera)
    : PluginStream(type, modes_of(type, camera->info()), type == ONI_SENSOR_DEPTH ? 65535 : 1024),
      which_(type == ONI_SENSOR_DEPTH ? SharedStream::kDepth : SharedStream::kInfrared),
      camera_(std::move(camera)) {}

SimulatedStream::~SimulatedStream() { stop(); }

OniStatus SimulatedStream::start() {
  if (running_.exchange(true)) return ONI_STATUS_OK;
  thread_ = std::thread([this] { run(); });
  return ONI_STATUS_OK;
}

void SimulatedStream::stop() {
  running_ = false;
  if (thread_.joinable()) thread_.join();
}

float SimulatedStream::horizontal_fov_rad(const OniVideoMode& mode) const {
  return static_cast<float>(2.0 * std::atan(0.5 * mode.resolutionX / camera_->info().focal_px));
}
float SimulatedStream::vertical_fov_rad(const OniVideoMode& mode) const {
  return static_cast<float>(2.0 * std::atan(0.5 * mode.resolutionY / camera_->info().focal_px));
}

void SimulatedStream::run() {
  uint32_t seen = camera_->newest(which_);
  while (running_) {
    camera_->want(which_);
    const uint32_t newest = camera_->newest(which_);
    if (newest == seen || !camera_->plugged()) {
      camera_->wait_newer(which_, newest);
      continue;
    }
    seen = newest;
    OniFrame* frame = begin_frame(0, 0);
    if (frame == nullptr) continue;
    SharedCameraReader::Stamp stamp;
    if (camera_->copy(which_, newest, static_cast<uint16_t*>(frame->data), &stamp)) {
      frame->timestamp = stamp.time_us;
      frame->frameIndex = stamp.index;
      end_frame(frame);
    } else {
      drop_frame(frame);
    }
  }
}

SimulatedDevice::SimulatedDevice(std::shared_ptr<SharedCameraReader> camera)
    : PluginDevice(camera->info().serial), camera_(std::move(camera)) {
  for (const OniSensorType type : {ONI_SENSOR_DEPTH, ONI_SENSOR_IR})
    add_sensor(type, modes_of(type, camera_->info()));
}

oni::driver::StreamBase* SimulatedDevice::createStream(OniSensorType type) {
  return has_sensor(type) ? new SimulatedStream(type, camera_) : nullptr;
}

void SimulatedDevice::destroyStream(oni::driver::StreamBase* stream) { delete stream; }

}  // namespace knav
