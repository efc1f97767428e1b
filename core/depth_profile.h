#pragma once

#include <cstdint>
#include <vector>

namespace knav {

/// What becomes of an obstacle's pixels as the robot drives up to it.
enum class HeightClass : std::uint8_t {
  kNone = 0,    ///< no obstacle in the column
  kLow = 1,     ///< its top drops out of the view's lower edge (a box)
  kMiddle = 2,  ///< stays in view (walls, people)
  kHigh = 3,    ///< its underside leaves by the upper edge (a sign)
  kBlind = 4,   ///< the column shows nothing at all, not even the floor, which is in the view: no obstacle, or one too near
};

/// The nearest obstacle per image column, and where the column was really seen free (paper section III.C).
/// The vectors have one entry per column, `rows` possibly none at all. Column u looks along ((u - cx) / fx, 1) in (right, forward),
/// parallel to the floor; all distances are along the forward axis, in metres.
struct DepthProfile {
  double stamp_s = 0.0;
  double fx_px = 0.0;
  double cx_px = 0.0;
  double camera_height_m = 0.0;
  double range_max_m = 20.0;
  std::vector<float> z_m;          ///< NaN: no obstacle seen
  std::vector<float> free_from_m;  ///< NaN: nothing seen free
  std::vector<float> free_to_m;
  std::vector<HeightClass> height_class;
  std::vector<std::uint8_t> rows;  ///< of the image that show the obstacle, 255 = that many or more; empty: not known
};

}  // namespace knav
