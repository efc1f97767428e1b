#include "openni2_driver/sensor_frame.h"

#include <algorithm>

namespace knav {

void copy_pixels(const SensorFrame& frame, uint16_t* out) {
  const auto width = frame.width_px;
  for (int v = 0; v < frame.height_px; ++v) {
    const uint16_t* row = frame.pixels + static_cast<std::ptrdiff_t>(v) * frame.stride_px;
    uint16_t* to = out + static_cast<std::ptrdiff_t>(v) * width;
    if (frame.mirrored) {
      std::reverse_copy(row, row + width, to);
    } else {
      std::copy(row, row + width, to);
    }
    if (frame.units_per_mm > 1) {
      const int units = frame.units_per_mm;
      std::transform(to, to + width, to,
                     [units](uint16_t value) { return static_cast<uint16_t>((value + units / 2) / units); });
    }
  }
}

}  // namespace knav
