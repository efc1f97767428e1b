#include "openni2_driver/openni_session.h"

#include <OniCAPI.h>
#include <OpenNI.h>
#include <fmt/format.h>

#include <array>

#include "core/error.h"

namespace knav {
namespace {

openni::SensorType sensor_type(SensorStream stream) {
  return stream == SensorStream::kDepth ? openni::SENSOR_DEPTH : openni::SENSOR_IR;
}
const char* stream_name(SensorStream stream) { return stream == SensorStream::kDepth ? "depth" : "IR"; }

bool wanted_format(SensorStream stream, openni::PixelFormat format) {
  if (stream == SensorStream::kInfrared) return format == openni::PIXEL_FORMAT_GRAY16;
  return format == openni::PIXEL_FORMAT_DEPTH_1_MM || format == openni::PIXEL_FORMAT_DEPTH_100_UM;
}

std::string mode_text(const openni::VideoMode& mode) {
  return fmt::format("{}x{}@{}", mode.getResolutionX(), mode.getResolutionY(), mode.getFps());
}

std::string last_error() {
  std::string text = openni::OpenNI::getExtendedError();
  for (char& c : text) {
    if (c < ' ') c = ' ';
  }
  while (!text.empty() && text.back() == ' ') text.pop_back();
  return text.empty() ? "no reason given" : text;
}

/// Wakes the reader when a stream has a frame. Over the C interface: the C++ listener calls OpenNI2 back from
/// the stream's thread, which ends with the stream, and that is deadly later (parked_thread.h).
class FrameSignal {
 public:
  explicit FrameSignal(std::function<void()> wake) : wake_(std::move(wake)) {}
  bool connect(OniStreamHandle stream) {
    return oniStreamRegisterNewFrameCallback(
               stream, [](OniStreamHandle, void* self) { static_cast<FrameSignal*>(self)->wake_(); }, this,
               &handle_) == ONI_STATUS_OK;
  }
  void disconnect(OniStreamHandle stream) { oniStreamUnregisterNewFrameCallback(stream, handle_); }

 private:
  std::function<void()> wake_;
  OniCallbackHandle handle_ = nullptr;
};

struct OpenStream {
  explicit OpenStream(const std::function<void()>& wake) : signal(wake) {}
  FrameSignal signal;  // before the stream, which may still call it while it is destroyed
  openni::VideoStream stream;
  double horizontal_fov_rad = 0.0, vertical_fov_rad = 0.0;
  bool mirrored = false;
};

}  // namespace

struct OpenNISession::Parts {
  std::shared_ptr<OpenNIRuntime> runtime;
  OpenNIDeviceConfig config;
  std::function<void()> wake;
  openni::Device device;
  bool is_file = false;
  std::string uri, vendor, name, serial;
  uint64_t disconnections = 0, ends_of_file = 0;
  std::array<std::unique_ptr<OpenStream>, kSensorStreamCount> streams;

  void select_mode(SensorStream which, openni::VideoStream& stream) {
    if (is_file) return;
    const openni::SensorInfo* info = device.getSensorInfo(sensor_type(which));
    const auto& modes = info->getSupportedVideoModes();
    std::string offered;
    for (int i = 0; i < modes.getSize(); ++i) {
      if (!wanted_format(which, modes[i].getPixelFormat())) continue;
      offered += (offered.empty() ? "" : ", ") + mode_text(modes[i]);
      if (modes[i].getResolutionX() != config.width_px || modes[i].getResolutionY() != config.height_px ||
          modes[i].getFps() != config.rate_hz) {
        continue;
      }
      if (stream.setVideoMode(modes[i]) == openni::STATUS_OK) return;
      throw UserError(fmt::format("{}: refuses {} for its {} stream: {}", uri, mode_text(modes[i]),
                                  stream_name(which), last_error()));
    }
    throw UserError(fmt::format("{}: has no {} mode {}x{}@{} (width_px, height_px, rate_hz); it offers {}.",
                                uri, stream_name(which), config.width_px, config.height_px, config.rate_hz,
                                offered.empty() ? "none in mm or 16 bit grey" : offered));
  }

  void start(SensorStream which) {
    auto open = std::make_unique<OpenStream>(wake);
    openni::VideoStream& stream = open->stream;
    if (device.getSensorInfo(sensor_type(which)) == nullptr) {
      throw UserError(fmt::format("{}: has no {} stream.", uri, stream_name(which)));
    }
    if (stream.create(device, sensor_type(which)) != openni::STATUS_OK) {
      throw UserError(fmt::format("{}: gives no {} stream: {}", uri, stream_name(which), last_error()));
    }
    select_mode(which, stream);
    stream.setMirroringEnabled(false);
    open->mirrored = stream.getMirroringEnabled();
    open->horizontal_fov_rad = static_cast<double>(stream.getHorizontalFieldOfView());
    open->vertical_fov_rad = static_cast<double>(stream.getVerticalFieldOfView());
    if (!open->signal.connect(stream._getHandle()) || stream.start() != openni::STATUS_OK) {
      throw UserError(
          fmt::format("{}: its {} stream does not start: {}", uri, stream_name(which), last_error()));
    }
    streams[static_cast<std::size_t>(which)] = std::move(open);
  }

  void stop(SensorStream which) {
    auto& open = streams[static_cast<std::size_t>(which)];
    if (!open) return;
    open->stream.stop();
    open->signal.disconnect(open->stream._getHandle());
    open->stream.destroy();
    open.reset();
  }
};

OpenNISession::OpenNISession(std::shared_ptr<OpenNIRuntime> runtime, const ResolvedDevice& device,
                             const OpenNIDeviceConfig& config, std::function<void()> wake)
    : parts_(std::make_unique<Parts>()) {
  Parts& p = *parts_;
  p.runtime = std::move(runtime);
  p.config = config;
  p.wake = std::move(wake);
  p.uri = device.uri;
  p.is_file = device.is_file;
  p.disconnections = p.runtime->disconnections(p.uri);
  p.ends_of_file = p.runtime->ends_of_file(p.uri);
  if (p.device.open(p.uri.c_str()) != openni::STATUS_OK) {
    throw UserError(fmt::format(
        "{}: cannot be opened: {}. {}", p.uri, last_error(),
        p.is_file
            ? "Is it a .oni recording, and is the OniFile driver beside the others (docs/driver.md)?"
            : "Does another program use it, and may you use its USB port (udev rules, docs/driver.md)?"));
  }
  const openni::DeviceInfo& info = p.device.getDeviceInfo();
  p.vendor = info.getVendor();
  p.name = info.getName();
  std::array<char, 256> serial{};
  int size = static_cast<int>(serial.size());
  if (p.device.getProperty(ONI_DEVICE_PROPERTY_SERIAL_NUMBER, serial.data(), &size) == openni::STATUS_OK) {
    serial.back() = '\0';
    p.serial = serial.data();
  }
  if (p.device.isImageRegistrationModeSupported(openni::IMAGE_REGISTRATION_DEPTH_TO_COLOR)) {
    p.device.setImageRegistrationMode(openni::IMAGE_REGISTRATION_OFF);
  }
  if (p.is_file) {
    openni::PlaybackControl* playback = p.device.getPlaybackControl();
    if (playback != nullptr) {
      playback->setSpeed(1.0F);  // as fast as possible (0) drops frames
      playback->setRepeatEnabled(config.playback_repeat);
    }
  }
}

void OpenNISession::configure(const OpenNIDeviceConfig& config) {
  Parts& p = *parts_;
  const bool same_mode = config.width_px == p.config.width_px && config.height_px == p.config.height_px &&
                         config.rate_hz == p.config.rate_hz;
  p.config = config;
  if (p.is_file) {
    openni::PlaybackControl* playback = p.device.getPlaybackControl();
    if (playback != nullptr) playback->setRepeatEnabled(config.playback_repeat);
  } else if (!same_mode) {
    p.stop(SensorStream::kDepth);
    p.stop(SensorStream::kInfrared);
  }
}

OpenNISession::~OpenNISession() {
  if (parts_->is_file) {
    // The stock file driver's thread walks its list of streams without a lock, all the time once none is started: taking the last one
    // off that list crashes one time in twenty on a busy machine. Closing the device ends the thread first, and the streams with it;
    // what is left of them here (a few hundred bytes) must not be destroyed again.
    for (auto& open : parts_->streams) {
      if (!open) continue;
      open->stream.stop();
      open->signal.disconnect(open->stream._getHandle());
    }
    parts_->device.close();
    for (auto& open : parts_->streams) (void)open.release();
    return;
  }
  parts_->stop(SensorStream::kDepth);
  parts_->stop(SensorStream::kInfrared);
  parts_->device.close();
}

void OpenNISession::set_streaming(SensorStream stream, bool on) {
  if (on == streaming(stream)) return;
  if (on) {
    parts_->start(stream);
  } else {
    parts_->stop(stream);
  }
}

bool OpenNISession::streaming(SensorStream stream) const {
  return parts_->streams[static_cast<std::size_t>(stream)] != nullptr;
}

bool OpenNISession::read(const std::function<void(const SensorFrame&)>& handle) {
  // Without a wait: OpenNI2's own wait begins anew with every frame of any device of the process.
  std::array<openni::VideoStream*, kSensorStreamCount> streams{};
  for (std::size_t i = 0; i < streams.size(); ++i)
    streams[i] = parts_->streams[i] ? &parts_->streams[i]->stream : nullptr;
  int ready = -1;
  if (openni::OpenNI::waitForAnyStream(streams.data(), kSensorStreamCount, &ready, 0) != openni::STATUS_OK ||
      ready < 0) {
    return false;
  }
  OpenStream& open = *parts_->streams[static_cast<std::size_t>(ready)];
  openni::VideoFrameRef image;
  if (open.stream.readFrame(&image) != openni::STATUS_OK || !image.isValid()) return false;

  SensorFrame frame;
  frame.stream = static_cast<SensorStream>(ready);
  if (!wanted_format(frame.stream, image.getVideoMode().getPixelFormat())) {
    throw UserError(
        fmt::format("{}: its {} frames come in OpenNI2's pixel format {}, not in mm or 16 bit grey.", uri(),
                    stream_name(frame.stream), static_cast<int>(image.getVideoMode().getPixelFormat())));
  }
  frame.pixels = static_cast<const uint16_t*>(image.getData());
  frame.width_px = image.getWidth();
  frame.height_px = image.getHeight();
  frame.stride_px = image.getStrideInBytes() / static_cast<int>(sizeof(uint16_t));
  if (frame.stride_px < frame.width_px ||
      image.getDataSize() <
          (frame.stride_px * (frame.height_px - 1) + frame.width_px) * static_cast<int>(sizeof(uint16_t))) {
    return true;  // a frame cut short is dropped; its index makes the gap seen
  }
  frame.units_per_mm = image.getVideoMode().getPixelFormat() == openni::PIXEL_FORMAT_DEPTH_100_UM ? 10 : 1;
  frame.mirrored = open.mirrored;
  frame.device_time_us = image.getTimestamp();
  frame.index = image.getFrameIndex();
  frame.horizontal_fov_rad = open.horizontal_fov_rad;
  frame.vertical_fov_rad = open.vertical_fov_rad;
  handle(frame);
  return true;
}

bool OpenNISession::unplugged() const {
  return parts_->runtime->disconnections(parts_->uri) != parts_->disconnections;
}
bool OpenNISession::at_end_of_file() const {
  return parts_->is_file && parts_->runtime->ends_of_file(parts_->uri) != parts_->ends_of_file;
}
const std::string& OpenNISession::uri() const { return parts_->uri; }
const std::string& OpenNISession::vendor() const { return parts_->vendor; }
const std::string& OpenNISession::name() const { return parts_->name; }
const std::string& OpenNISession::serial() const { return parts_->serial; }

}  // namespace knav
