#pragma once

#include <cstdint>
#include <vector>

namespace knav {

/// Turning a camera moves the pixels of one row along that row by a projective map of the line. Both rolling
/// shutter and levelling are such turns. Nearest neighbour, never blended.
class RowWarp {
 public:
  /// Column x' of the result (normalised, x' = (u' - cx) / fx) is taken from x = (a x' + b) / (c x' + d).
  struct Map {
    double a = 1.0, b = 0.0, c = 0.0, d = 1.0;
  };
  /// Works out the source columns. @return false if no column moves by half a pixel (copy the row as it is)
  bool set(const Map& map, double fx_px, double cx_px, int width_px);
  /// to[u'] = from[source of u'], NaN where that lies outside.
  void take(const float* from, float* to) const;
  /// Normalised source position (unrounded) of each column of the result.
  const std::vector<float>& source_x() const { return source_x_; }

 private:
  std::vector<std::int32_t> source_;
  std::vector<float> source_x_;
};

}  // namespace knav
