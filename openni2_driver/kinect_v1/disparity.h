#pragma once

#include <array>
#include <cstdint>

namespace knav {

/// A Kinect v1's own numbers, as its firmware tells them. The defaults are the nominal ones.
struct ZeroPlane {
  double emitter_distance_cm = 7.5;    ///< from the IR projector to the IR camera
  double reference_distance_cm = 120;  ///< of the plane whose pattern the Kinect compares with
  double pixel_size_cm = 0.1042;       ///< of a pixel of the 1280 column sensor, on that plane
  double const_shift = 200.0;

  /// Of the 640 column image.
  double focal_px() const { return reference_distance_cm / (2.0 * pixel_size_cm); }
};

/// Millimetres of the raw 11-bit codes. The stock conversion clamps at 10 m and wraps around beyond code 1087
/// or so, where the formula turns negative; this one goes on to max_mm and answers 0 (invalid) for what lies
/// outside.
class DisparityTable {
 public:
  static constexpr int kNoReading = 2047;
  static constexpr double kNearestMm = 400.0;
  static constexpr double kFarthestMm = 26000.0;

  explicit DisparityTable(const ZeroPlane& plane = ZeroPlane());
  /// @param code a raw reading; any 16 bit value is safe
  uint16_t mm(uint16_t code) const { return table_mm_[code & 2047U]; }
  void convert(const uint16_t* codes, std::size_t count, uint16_t* out_mm) const;

 private:
  std::array<uint16_t, 2048> table_mm_;
};

/// The exact formula [mm]; not positive where a code means nothing.
double depth_of_code_mm(double code, const ZeroPlane& plane);

}  // namespace knav
