#pragma once

#include <cstdint>
#include <vector>

#include "core/random.h"

namespace knav {

/// White noise seen through a window, sd 1: a torus that each frame reads from another place, so that a frame
/// costs no random numbers.
class NoiseField {
 public:
  static constexpr float kUnit = 1.0f / 4096.0f;  ///< of a count

  /// @param across, down the window: a pixel of it weighs across[its column] x down[its row]
  NoiseField(std::uint64_t seed, const std::vector<float>& across, const std::vector<float>& down);

  struct Place {
    std::uint32_t column = 0, row = 0;
  };
  /// @param width_px of the rows to be read there; less than the field's width
  static Place any_place(int width_px, RandomStream* random);
  const std::int16_t* row(const Place& place, int row_px) const;

 private:
  std::vector<std::int16_t> counts_;
};

}  // namespace knav
