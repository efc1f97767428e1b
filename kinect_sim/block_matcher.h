#pragma once

#include <cstdint>
#include <vector>

#include "core/random.h"
#include "kinect_sim/noise_field.h"

namespace knav {

/// How the Kinect reads disparities: blocks of about 9 x 9 px of its speckle pattern are matched, and the
/// result is rounded to codes of 1/8 px. What real frames show of that (docs/simulator.md):
///
/// - Noise of the block's size, for neighbours share most of their speckles. The error depends on where the
///   speckles lie between the pixels too, so that some of it changes with the disparity and is back after 1
///   px.
/// - On a slanted surface a block holds different disparities and answers with that of its speckles' middle,
///   not of its own: an error of the slope times the distance between the two.
/// - Codes are not equally wide: in each half pixel, four codes, two are wider than the other two. A slanted
///   surface shows ripples, less so where a block's own disparities range over a half pixel.
class BlockMatcher {
 public:
  /// @param noise_sd_codes before rounding, on a surface seen square
  /// @param lever_px       sd of the distance between the speckles' middle and the block's, in x as in y
  BlockMatcher(std::uint64_t seed, int width_px, double noise_sd_codes, double lever_px);

  /// Each frame reads the noise elsewhere. Rows are then to come in rising order.
  void start_frame(RandomStream* random);

  /// One row of disparities [codes].
  struct Row {
    const float* surface;     ///< of what is there, [-1] too: its slope counts
    const float* seen;        ///< with the device's own error
    const std::int32_t* add;  ///< whole codes that the device takes off after matching; at least 0
    float noisier_below;      ///< where `surface` is less than this, towards saturation, noise grows
  };
  /// @param code whole codes
  void match(int row, const Row& in, float* code);
  /// For whatever else varies from block to block.
  const NoiseField& block_noise() const { return block_; }

 private:
  struct Kernel;
  NoiseField block_, lever_x_, lever_y_;
  NoiseField::Place steady_, sine_, cosine_, lever_x_place_, lever_y_place_;
  float steady_codes_, changing_codes_, lever_;
  int width_px_, last_row_ = -1;
  std::vector<float> above_;  ///< the row before's surface
};

}  // namespace knav
