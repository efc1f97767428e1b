#include "kinect_sim/openni2_output.h"

#include <fmt/format.h>

#include <cmath>

namespace knav {
namespace {

constexpr double kDeviceZero_s = 5.0;  // a device's clock starts anywhere

SharedCameraInfo info_of(const Simulator& simulator) {
  SharedCameraInfo info;
  info.serial = fmt::format("SIM{:010d}", simulator.config().device_seed);
  info.width_px = simulator.camera().width_px;
  info.height_px = simulator.camera().height_px;
  info.focal_px = simulator.camera().fx_px;
  info.rate_hz = simulator.config().frame_rate_hz;
  return info;
}

}  // namespace

OpenNI2Output::OpenNI2Output(const std::string& name, const Simulator& simulator)
    : writer_(name, info_of(simulator)) {}

bool OpenNI2Output::wanted() const {
  return writer_.wanted(SharedStream::kDepth) || writer_.wanted(SharedStream::kInfrared);
}

void OpenNI2Output::render(Simulator& simulator, const FrameRequest& request) {
  const auto time_us = static_cast<std::uint64_t>(
      std::llround((request.stamp_s - simulator.config().start_time_s + kDeviceZero_s) * 1e6));
  for (const SharedStream stream : {SharedStream::kDepth, SharedStream::kInfrared}) {
    if (!writer_.wanted(stream)) continue;
    cv::Mat image(simulator.camera().height_px, simulator.camera().width_px, CV_16UC1,
                  writer_.begin_frame(stream));
    if (stream == SharedStream::kDepth) {
      simulator.render(request, &image);
    } else {
      simulator.render_infrared(request, &image);
    }
    writer_.end_frame(stream, time_us, static_cast<int>(request.index));
  }
}

}  // namespace knav
