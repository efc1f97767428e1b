#include "openni2_driver/kinect_v1/kinect_v1_device.h"

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

constexpr int kWidth = 640, kHeight = 480, kRateHz = 30;

std::vector<OniVideoMode> modes_of(OniSensorType type) {
  return {{type == ONI_SENSOR_DEPTH ? ONI_PIXEL_FORMAT_DEPTH_1_MM : ONI_PIXEL_FORMAT_GRAY16, kWidth, kHeight,
           kRateHz}};
}

}  // namespace

KinectV1Stream::KinectV1Stream(OniSensorType type, KinectV1Device& device)
    : PluginStream(type, modes_of(type), type == ONI_SENSOR_DEPTH ? 65535 : 1024),
      type_(type),
      device_(device) {}

KinectV1Stream::~KinectV1Stream() { stop(); }

OniStatus KinectV1Stream::start() {
  if (running_.exchange(true)) return ONI_STATUS_OK;
  const bool started = type_ == ONI_SENSOR_DEPTH ? device_.loop_.start_depth(device_.handle_)
                                                 : device_.loop_.start_ir(device_.handle_);
  if (!started) running_ = false;
  return started ? ONI_STATUS_OK : ONI_STATUS_ERROR;
}

void KinectV1Stream::stop() {
  if (!running_.exchange(false)) return;
  if (type_ == ONI_SENSOR_DEPTH) {
    device_.loop_.stop_depth(device_.handle_);
  } else {
    device_.loop_.stop_ir(device_.handle_);
  }
}

float KinectV1Stream::horizontal_fov_rad(const OniVideoMode& /*mode*/) const {
  return static_cast<float>(2.0 * std::atan(0.5 * kWidth / device_.plane_.focal_px()));
}
float KinectV1Stream::vertical_fov_rad(const OniVideoMode& /*mode*/) const {
  return static_cast<float>(2.0 * std::atan(0.5 * kHeight / device_.plane_.focal_px()));
}

void KinectV1Stream::send(const uint16_t* raw, uint64_t time_us) {
  if (!running_) return;
  OniFrame* frame = begin_frame(time_us, ++index_);
  if (frame == nullptr) return;
  auto* out = static_cast<uint16_t*>(frame->data);
  constexpr std::size_t kPixels = static_cast<std::size_t>(kWidth) * kHeight;
  if (type_ == ONI_SENSOR_DEPTH) {
    device_.table_.convert(raw, kPixels, out);
  } else {
    std::copy(raw, raw + kPixels, out);
  }
  end_frame(frame);
}

KinectV1Device::KinectV1Device(FreenectLoop& loop, const KinectOnUsb& kinect)
    : PluginDevice(kinect.serial), loop_(loop) {
  handle_ = loop_.open(kinect, this);
  if (handle_ == nullptr) return;
  plane_ = loop_.zero_plane(handle_);
  table_ = DisparityTable(plane_);
  add_sensor(ONI_SENSOR_DEPTH, modes_of(ONI_SENSOR_DEPTH));
  if (loop_.has_ir()) add_sensor(ONI_SENSOR_IR, modes_of(ONI_SENSOR_IR));
}

KinectV1Device::~KinectV1Device() {
  if (handle_ != nullptr) loop_.close(handle_);
}

oni::driver::StreamBase* KinectV1Device::createStream(OniSensorType type) {
  if (!has_sensor(type)) return nullptr;
  std::lock_guard<std::mutex> lock(mutex_);
  KinectV1Stream*& place = type == ONI_SENSOR_DEPTH ? depth_ : ir_;
  if (place != nullptr) return nullptr;  // the hardware has one of each
  place = new KinectV1Stream(type, *this);
  return place;
}

void KinectV1Device::destroyStream(oni::driver::StreamBase* stream) {
  auto* ours = static_cast<KinectV1Stream*>(stream);
  // Stopped without the lock, which the loop's thread may be waiting for.
  ours->stop();
  {
    std::lock_guard<std::mutex> lock(mutex_);
    (ours->type() == ONI_SENSOR_DEPTH ? depth_ : ir_) = nullptr;
  }
  delete ours;
}

void KinectV1Device::on_depth(const uint16_t* codes, uint32_t ticks) {
  const uint64_t time_us = depth_clock_.to_us(ticks);
  std::lock_guard<std::mutex> lock(mutex_);
  if (depth_ != nullptr) depth_->send(codes, time_us);
}

void KinectV1Device::on_ir(const uint16_t* pixels, uint32_t ticks) {
  const uint64_t time_us = ir_clock_.to_us(ticks);
  std::lock_guard<std::mutex> lock(mutex_);
  if (ir_ != nullptr) ir_->send(pixels, time_us);
}

}  // namespace knav
