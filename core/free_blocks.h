#pragma once

#include <cstdint>
#include <vector>

#include "core/tsdf_grid.h"

namespace knav {

/// Which square blocks of 8 x 8 quads hold nothing but free space, or nothing but unknown, and how far round them it is so: a ray
/// may cross all that in one step without passing over anything, as what it would have found in each of the cells is known.
class FreeBlocks {
 public:
  static constexpr int kShift = 3;  ///< a block's side is 2^this quads

  /// Quads [low_x, high_x] x [low_y, high_y].
  struct Square {
    int low_x, high_x, low_y, high_y;
  };

  /// Looks at the blocks within `reach_m` of the point.
  void build(const TsdfGrid& grid, double x_m, double y_m, double reach_m);

  /// What the block of a quad is part of.
  enum class Kind { kMixed, kFree, kUnknown };
  /// @param square  unless mixed, the largest centred on the block of quad (ix, iy) of whose quads all corners are known and above
  ///                zero, or all unknown
  Kind kind(int ix, int iy, Square* square) const {
    const std::uint8_t rings = at(ix, iy);
    if (rings == 0) return Kind::kMixed;
    *square = block(ix, iy, (rings & kRings) - 1);
    return rings & kUnknown ? Kind::kUnknown : Kind::kFree;
  }
  /// Of one quad's block alone.
  static Square block(int ix, int iy) { return block(ix, iy, 0); }

 private:
  // A block's byte: how many blocks away the next mixed one is, and whether it is unknown. Free and unknown blocks never touch, as
  // they would share cells.
  static constexpr std::uint8_t kRings = 127, kMostRings = 126, kUnknown = 128;

  std::uint8_t at(int ix, int iy) const {
    const auto x = static_cast<unsigned>(ix - low_x_) >> kShift, y = static_cast<unsigned>(iy - low_y_) >> kShift;
    return x < width_ && y < height_ ? rings_[y * width_ + x] : 0;
  }
  static Square block(int ix, int iy, int around) {
    constexpr int kInside = (1 << kShift) - 1;
    const int more = around << kShift;
    return {(ix & ~kInside) - more, (ix | kInside) + more, (iy & ~kInside) - more, (iy | kInside) + more};
  }
  void classify_row(const TsdfGrid& grid, unsigned row);
  void count_rings();

  int low_x_ = 0, low_y_ = 0;  ///< the first quad of the first block
  unsigned width_ = 0, height_ = 0;  ///< in blocks
  std::vector<std::uint8_t> rings_, unknown_;
  std::vector<std::int8_t> lowest_, highest_;  ///< scratch of a row of blocks: of each column's cells
};

}  // namespace knav
