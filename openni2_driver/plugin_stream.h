#pragma once

// OpenNI2's driver interface takes these two from XnLib, which Debian does not package.
#define XN_NEW(type, ...) new type(__VA_ARGS__)
#define XN_DELETE(object) delete (object)
#include <Driver/OniDriverAPI.h>

#include <atomic>
#include <cstdint>
#include <vector>

namespace knav {

/// The properties every stream of our plugins answers for. OpenNI2's recorder wants all of them: without
/// CROPPING a recording plays back no frames at all, and pixels at or above MAX_VALUE are recorded wrongly,
/// without a word.
class PluginStream : public oni::driver::StreamBase {
 public:
  /// @param modes the stream's; the first is the one it begins with
  /// @param max_value greater than every pixel
  PluginStream(OniSensorType type, std::vector<OniVideoMode> modes, int max_value);

  OniStatus getProperty(int property, void* data, int* size) override;
  OniStatus setProperty(int property, const void* data, int size) override;
  OniBool isPropertySupported(int property) override;

 protected:
  virtual float horizontal_fov_rad(const OniVideoMode& mode) const = 0;
  virtual float vertical_fov_rad(const OniVideoMode& mode) const = 0;

  OniVideoMode mode() const { return mode_; }
  /// A frame of the current mode with everything but its pixels filled in; null if the runtime has none to
  /// give.
  OniFrame* begin_frame(uint64_t time_us, int index);
  /// Hands it to the runtime.
  void end_frame(OniFrame* frame);
  /// Gives a frame back that was not filled after all.
  void drop_frame(OniFrame* frame);
  std::atomic<bool> running_{false};

 private:
  OniSensorType type_;
  std::vector<OniVideoMode> modes_;
  OniVideoMode mode_;
  int max_value_;
};

}  // namespace knav
