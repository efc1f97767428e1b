// A libfreenect for tests, with what fakenect lacks: serial numbers, the zero plane, IR, and Kinects that
// come and go. The functions the plugin calls, with libfreenect's own header, names and meanings; the test's
// LD_LIBRARY_PATH puts it in libfreenect's place.

#include <libfreenect.h>
#include <libfreenect_registration.h>

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "scripted_kinect.h"

namespace scripted = knav::scripted;

struct _freenect_context {
  std::vector<freenect_device*> open;
  std::chrono::steady_clock::time_point next_frame = std::chrono::steady_clock::now();
  unsigned frame = 0;
};

struct _freenect_device {
  freenect_context* context = nullptr;
  std::string serial;
  void* user = nullptr;
  freenect_depth_cb on_depth = nullptr;
  freenect_video_cb on_video = nullptr;
  bool depth = false, video = false;
  std::vector<uint16_t> depth_codes, pixels;
};

namespace {

std::vector<std::string> on_usb() {
  const char* path = std::getenv("KINECT_NAV_SCRIPTED_KINECTS");
  std::ifstream file(path == nullptr ? "" : path);
  std::vector<std::string> serials;
  std::string serial;
  while (file >> serial) serials.push_back(serial);
  return serials;
}

bool is_on_usb(const std::string& serial) {
  for (const std::string& there : on_usb()) {
    if (there == serial) return true;
  }
  return false;
}

freenect_frame_mode mode_of(bool depth) {
  freenect_frame_mode mode{};
  mode.is_valid = 1;
  mode.resolution = FREENECT_RESOLUTION_MEDIUM;
  mode.width = scripted::kWidth;
  mode.height = static_cast<int16_t>(depth ? scripted::kHeight : scripted::kInfraredHeight);
  mode.bytes = mode.width * mode.height * 2;
  mode.data_bits_per_pixel = static_cast<int8_t>(depth ? 11 : 10);
  mode.padding_bits_per_pixel = static_cast<int8_t>(depth ? 5 : 6);
  mode.framerate = 30;
  if (depth) {
    mode.depth_format = FREENECT_DEPTH_11BIT;
  } else {
    mode.video_format = FREENECT_VIDEO_IR_10BIT;
  }
  return mode;
}

void send(freenect_device* device, unsigned frame) {
  const uint32_t ticks = frame * scripted::kTicksPerFrame;
  if (device->depth && device->on_depth != nullptr) {
    device->depth_codes.resize(static_cast<std::size_t>(scripted::kWidth * scripted::kHeight));
    for (int i = 0; i < scripted::kWidth * scripted::kHeight; ++i) {
      device->depth_codes[static_cast<std::size_t>(i)] =
          scripted::code(i % scripted::kWidth, i / scripted::kWidth, frame);
    }
    device->on_depth(device, device->depth_codes.data(), ticks);
  }
  if (device->video && device->on_video != nullptr) {
    device->pixels.resize(static_cast<std::size_t>(scripted::kWidth * scripted::kInfraredHeight));
    for (int i = 0; i < scripted::kWidth * scripted::kInfraredHeight; ++i) {
      device->pixels[static_cast<std::size_t>(i)] =
          scripted::infrared(i % scripted::kWidth, i / scripted::kWidth, frame);
    }
    device->on_video(device, device->pixels.data(), ticks);
  }
}

}  // namespace

extern "C" {

int freenect_init(freenect_context** context, freenect_usb_context*) {
  *context = new freenect_context;
  return 0;
}
int freenect_shutdown(freenect_context* context) {
  delete context;
  return 0;
}
void freenect_set_log_level(freenect_context*, freenect_loglevel) {}
void freenect_select_subdevices(freenect_context*, freenect_device_flags) {}
int freenect_num_devices(freenect_context*) { return static_cast<int>(on_usb().size()); }

int freenect_list_device_attributes(freenect_context*, freenect_device_attributes** list) {
  *list = nullptr;
  const std::vector<std::string> serials = on_usb();
  for (auto serial = serials.rbegin(); serial != serials.rend(); ++serial) {
    auto* entry = new freenect_device_attributes;
    entry->next = *list;
    entry->camera_serial = strdup(serial->c_str());
    *list = entry;
  }
  return static_cast<int>(serials.size());
}
void freenect_free_device_attributes(freenect_device_attributes* list) {
  while (list != nullptr) {
    freenect_device_attributes* next = list->next;
    free(const_cast<char*>(list->camera_serial));
    delete list;
    list = next;
  }
}

int freenect_open_device_by_camera_serial(freenect_context* context, freenect_device** device,
                                          const char* serial) {
  if (!is_on_usb(serial)) return -1;
  *device = new freenect_device;
  (*device)->context = context;
  (*device)->serial = serial;
  context->open.push_back(*device);
  return 0;
}
int freenect_open_device(freenect_context* context, freenect_device** device, int index) {
  const std::vector<std::string> serials = on_usb();
  if (index < 0 || index >= static_cast<int>(serials.size())) return -1;
  return freenect_open_device_by_camera_serial(context, device,
                                               serials[static_cast<std::size_t>(index)].c_str());
}
int freenect_close_device(freenect_device* device) {
  auto& open = device->context->open;
  for (std::size_t i = 0; i < open.size(); ++i) {
    if (open[i] == device) open.erase(open.begin() + static_cast<std::ptrdiff_t>(i));
  }
  delete device;
  return 0;
}

void freenect_set_user(freenect_device* device, void* user) { device->user = user; }
void* freenect_get_user(freenect_device* device) { return device->user; }
void freenect_set_depth_callback(freenect_device* device, freenect_depth_cb callback) {
  device->on_depth = callback;
}
void freenect_set_video_callback(freenect_device* device, freenect_video_cb callback) {
  device->on_video = callback;
}

int freenect_get_video_mode_count() { return 1; }
freenect_frame_mode freenect_get_video_mode(int) { return mode_of(false); }
freenect_frame_mode freenect_find_depth_mode(freenect_resolution, freenect_depth_format format) {
  return format == FREENECT_DEPTH_11BIT ? mode_of(true) : freenect_frame_mode{};
}
int freenect_set_depth_mode(freenect_device*, const freenect_frame_mode mode) {
  return mode.is_valid && mode.depth_format == FREENECT_DEPTH_11BIT ? 0 : -1;
}
int freenect_set_video_mode(freenect_device*, freenect_frame_mode mode) {
  return mode.is_valid && mode.video_format == FREENECT_VIDEO_IR_10BIT ? 0 : -1;
}
int freenect_start_depth(freenect_device* device) {
  device->depth = true;
  return is_on_usb(device->serial) ? 0 : -1;
}
int freenect_start_video(freenect_device* device) {
  device->video = true;
  return is_on_usb(device->serial) ? 0 : -1;
}
int freenect_stop_depth(freenect_device* device) {
  device->depth = false;
  return 0;
}
int freenect_stop_video(freenect_device* device) {
  device->video = false;
  return 0;
}

freenect_registration freenect_copy_registration(freenect_device*) {
  freenect_registration registration{};
  const knav::ZeroPlane plane = scripted::zero_plane();
  registration.zero_plane_info.dcmos_emitter_dist = static_cast<float>(plane.emitter_distance_cm);
  registration.zero_plane_info.reference_distance = static_cast<float>(plane.reference_distance_cm);
  registration.zero_plane_info.reference_pixel_size = static_cast<float>(plane.pixel_size_cm);
  registration.const_shift = plane.const_shift;
  return registration;
}
int freenect_destroy_registration(freenect_registration*) { return 0; }

int freenect_process_events_timeout(freenect_context* context, timeval* timeout) {
  for (const freenect_device* device : context->open) {
    if (!is_on_usb(device->serial)) return -1;  // what libusb tells of a transfer to a device that is gone
  }
  const auto now = std::chrono::steady_clock::now();
  const auto limit =
      now + std::chrono::seconds(timeout->tv_sec) + std::chrono::microseconds(timeout->tv_usec);
  if (context->next_frame > limit) {
    std::this_thread::sleep_until(limit);
    return 0;
  }
  std::this_thread::sleep_until(context->next_frame);
  context->next_frame += std::chrono::microseconds(33333);
  if (context->next_frame < now) context->next_frame = now;
  ++context->frame;
  const std::vector<freenect_device*> open = context->open;
  for (freenect_device* device : open) send(device, context->frame);
  return 0;
}

}  // extern "C"
