#pragma once

#include <cstdint>
#include <vector>

namespace knav {

/// Turning a camera moves the pixels of one row along that row by a projective map of the line. Both rolling
/// shutter and levelling are such turns. Nearest neighbour, never blended. The shift changes by a few pixels
/// across a row, so a row is a few runs of pixels that move alike: copying runs costs a fifth of gathering
/// pixels one by one.
class RowWarp {
 public:
  /// Column x' of the result (normalised, x' = (u' - cx) / fx) is taken from x = (a x' + b) / (c x' + d).
  struct Map {
    double a = 1.0, b = 0.0, c = 0.0, d = 1.0;
  };
  /// Works out the runs. @return false if no column moves by half a pixel (copy the row as it is)
  bool set(const Map& map, double fx_px, double cx_px, int width_px);
  /// to[u'] = from[nearest source of u'], NaN where that lies outside.
  void take(const float* from, float* to) const;
  /// How far the source of column u' lies from u', unrounded [px].
  float shift_px(int u) const;

 private:
  struct Run {
    int begin, end, shift;
  };
  void add(int begin, int end, int shift);

  float a_ = 1.0f, b_ = 0.0f, c_ = 0.0f, d_ = 1.0f, fx_px_ = 1.0f, cx_px_ = 0.0f;
  int width_px_ = 0;
  std::vector<std::int32_t> block_shift_;
  std::vector<Run> runs_;
};

}  // namespace knav
