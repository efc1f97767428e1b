#include "openni2_driver/plugin_stream.h"

#include <cstring>

namespace knav {
namespace {

template <class T>
OniStatus answer(const T& value, void* data, int* size) {
  if (data == nullptr || *size < static_cast<int>(sizeof(T))) return ONI_STATUS_BAD_PARAMETER;
  std::memcpy(data, &value, sizeof(T));
  *size = static_cast<int>(sizeof(T));
  return ONI_STATUS_OK;
}

}  // namespace

PluginStream::PluginStream(OniSensorType type, std::vector<OniVideoMode> modes, int max_value)
    : type_(type), modes_(std::move(modes)), mode_(modes_.front()), max_value_(max_value) {}

OniStatus PluginStream::getProperty(int property, void* data, int* size) {
  switch (property) {
    case ONI_STREAM_PROPERTY_VIDEO_MODE:
      return answer(mode_, data, size);
    case ONI_STREAM_PROPERTY_HORIZONTAL_FOV:
      return answer(horizontal_fov_rad(mode_), data, size);
    case ONI_STREAM_PROPERTY_VERTICAL_FOV:
      return answer(vertical_fov_rad(mode_), data, size);
    case ONI_STREAM_PROPERTY_MIN_VALUE:
      return answer(0, data, size);
    case ONI_STREAM_PROPERTY_MAX_VALUE:
      return answer(max_value_, data, size);
    case ONI_STREAM_PROPERTY_STRIDE:
      return answer(mode_.resolutionX * 2, data, size);
    case ONI_STREAM_PROPERTY_MIRRORING:
      return answer(OniBool{FALSE}, data, size);
    case ONI_STREAM_PROPERTY_CROPPING: {
      const OniCropping whole = {FALSE, 0, 0, mode_.resolutionX, mode_.resolutionY};
      return answer(whole, data, size);
    }
    default:
      return ONI_STATUS_NOT_IMPLEMENTED;
  }
}

OniStatus PluginStream::setProperty(int property, const void* data, int size) {
  if (property == ONI_STREAM_PROPERTY_MIRRORING && size == static_cast<int>(sizeof(OniBool))) {
    OniBool on = FALSE;
    std::memcpy(&on, data, sizeof(on));
    return on == FALSE ? ONI_STATUS_OK : ONI_STATUS_NOT_SUPPORTED;
  }
  if (property != ONI_STREAM_PROPERTY_VIDEO_MODE) return ONI_STATUS_NOT_IMPLEMENTED;
  if (size != static_cast<int>(sizeof(OniVideoMode))) return ONI_STATUS_BAD_PARAMETER;
  if (running_) return ONI_STATUS_OUT_OF_FLOW;
  OniVideoMode wanted;
  std::memcpy(&wanted, data, sizeof(wanted));
  for (const OniVideoMode& mode : modes_) {
    if (mode.pixelFormat == wanted.pixelFormat && mode.resolutionX == wanted.resolutionX &&
        mode.resolutionY == wanted.resolutionY && mode.fps == wanted.fps) {
      mode_ = mode;
      return ONI_STATUS_OK;
    }
  }
  return ONI_STATUS_NOT_SUPPORTED;
}

OniBool PluginStream::isPropertySupported(int property) {
  switch (property) {
    case ONI_STREAM_PROPERTY_VIDEO_MODE:
    case ONI_STREAM_PROPERTY_HORIZONTAL_FOV:
    case ONI_STREAM_PROPERTY_VERTICAL_FOV:
    case ONI_STREAM_PROPERTY_MIN_VALUE:
    case ONI_STREAM_PROPERTY_MAX_VALUE:
    case ONI_STREAM_PROPERTY_STRIDE:
    case ONI_STREAM_PROPERTY_MIRRORING:
    case ONI_STREAM_PROPERTY_CROPPING:
      return TRUE;
    default:
      return FALSE;
  }
}

OniFrame* PluginStream::begin_frame(uint64_t time_us, int index) {
  OniFrame* frame = getServices().acquireFrame();
  if (frame == nullptr) return nullptr;
  frame->sensorType = type_;
  frame->videoMode = mode_;
  frame->width = mode_.resolutionX;
  frame->height = mode_.resolutionY;
  frame->stride = mode_.resolutionX * 2;
  frame->dataSize = frame->stride * frame->height;
  frame->croppingEnabled = FALSE;
  frame->cropOriginX = frame->cropOriginY = 0;
  frame->timestamp = time_us;
  frame->frameIndex = index;
  return frame;
}

void PluginStream::end_frame(OniFrame* frame) {
  raiseNewFrame(frame);
  getServices().releaseFrame(frame);
}

void PluginStream::drop_frame(OniFrame* frame) { getServices().releaseFrame(frame); }

}  // namespace knav
