#pragma once

#include <cstdint>
#include <vector>

#include "core/tsdf_grid.h"

namespace knav {

/// Which square blocks of quads hold nothing but free space, or nothing but unknown, so that a ray may cross
/// them in one step without passing over anything: what it would have found in each of their cells is known.
class FreeBlocks {
 public:
  static constexpr int kLevels = 3;
  static constexpr int kShift[kLevels] = {3, 5, 7};  ///< blocks of 8 x 8, 32 x 32 and 128 x 128

  /// Looks at the blocks within `reach_m` of the point.
  void build(const TsdfGrid& grid, double x_m, double y_m, double reach_m);

  /// How many of the levels the grid is large enough for.
  int levels() const { return levels_; }

  /// Whether all corners of each quad of the block round quad (ix, iy) are known and above zero.
  bool free(int level, int ix, int iy) const {
    const int shift = kShift[level], bits = bits_ - shift;
    const int x = (ix & mask_) >> shift, y = (iy & mask_) >> shift;
    return kind_[level][(static_cast<std::size_t>(y) << bits) | static_cast<std::size_t>(x)] == kFree;
  }
  /// Whether all corners of each quad of the block of the finest level round quad (ix, iy) are unknown.
  bool unknown(int ix, int iy) const {
    const int x = (ix & mask_) >> kShift[0], y = (iy & mask_) >> kShift[0];
    return kind_[0][(static_cast<std::size_t>(y) << (bits_ - kShift[0])) | static_cast<std::size_t>(x)] ==
           kUnknown;
  }

 private:
  enum Kind : std::uint8_t { kMixed, kFree, kUnknown };
  int bits_ = 0, mask_ = 0, levels_ = 0;
  std::vector<std::uint8_t> kind_[kLevels];
  std::vector<std::int8_t> lowest_, highest_;  ///< scratch of a row of blocks: of each column's cells
};

}  // namespace knav
