#include "openni2_driver/kinect_v1/disparity.h"

#include <cmath>

namespace knav {

// Codes count eighths of a pixel of the 640 column image, quarters of one of the 1280 column sensor; the 3/8
// is the firmware's rounding. Similar triangles over the zero plane give the rest.
double depth_of_code_mm(double code, const ZeroPlane& plane) {
  const double shift_px = (code - 4.0 * plane.const_shift) / 4.0 - 0.375;
  const double shift_cm = shift_px * plane.pixel_size_cm;
  const double left_cm = plane.emitter_distance_cm - shift_cm;
  if (left_cm <= 0.0) return -1.0;  // at infinity or beyond
  return 10.0 * (shift_cm * plane.reference_distance_cm / left_cm + plane.reference_distance_cm);
}

DisparityTable::DisparityTable(const ZeroPlane& plane) {
  for (int code = 0; code < static_cast<int>(table_mm_.size()); ++code) {
    const double depth_mm = depth_of_code_mm(code, plane);
    const bool plausible = code != kNoReading && depth_mm >= kNearestMm && depth_mm <= kFarthestMm;
    table_mm_[static_cast<std::size_t>(code)] =
        plausible ? static_cast<uint16_t>(std::lround(depth_mm)) : uint16_t{0};
  }
}

void DisparityTable::convert(const uint16_t* codes, std::size_t count, uint16_t* out_mm) const {
  for (std::size_t i = 0; i < count; ++i) out_mm[i] = mm(codes[i]);
}

}  // namespace knav
