#include "core/free_blocks.h"

#include <algorithm>

#include "core/multiversion.h"

namespace knav {
namespace {

KNAV_MULTIVERSION
void widen(const std::int8_t* value, int count, std::int8_t* lowest, std::int8_t* highest) {
  for (int k = 0; k < count; ++k) {
    lowest[k] = value[k] < lowest[k] ? value[k] : lowest[k];
    highest[k] = value[k] > highest[k] ? value[k] : highest[k];
  }
}

}  // namespace

void FreeBlocks::build(const TsdfGrid& grid, double x_m, double y_m, double reach_m) {
  bits_ = grid.bits();
  mask_ = grid.size_cells() - 1;
  for (levels_ = 0; levels_ < kLevels && kShift[levels_] <= bits_; ++levels_) {
    const auto side = static_cast<std::size_t>(grid.size_cells() >> kShift[levels_]);
    kind_[levels_].assign(side * side, kMixed);
  }
  if (levels_ == 0) return;
  // Whole blocks of the finest level that lie in the window: its last row and column of quads end outside.
  constexpr int kStep = 1 << kShift[0];
  const auto up = [](int i) { return (i + kStep - 1) & ~(kStep - 1); };
  const auto down = [](int i) { return i & ~(kStep - 1); };
  const int reach = static_cast<int>(reach_m / grid.resolution_m()) + kStep;
  const int last_x = grid.first_x() + grid.size_cells() - 1, last_y = grid.first_y() + grid.size_cells() - 1;
  const int low_x = std::max(up(grid.first_x()), down(grid.cell_of(x_m) - reach));
  const int high_x = std::min(down(last_x), up(grid.cell_of(x_m) + reach));
  const int low_y = std::max(up(grid.first_y()), down(grid.cell_of(y_m) - reach));
  const int high_y = std::min(down(last_y), up(grid.cell_of(y_m) + reach));
  if (low_x >= high_x) return;
  // A block of quads stands on a row and a column of cells more.
  const int cells = high_x - low_x + 1;
  lowest_.resize(static_cast<std::size_t>(cells));
  highest_.resize(lowest_.size());
  for (int y = low_y; y < high_y; y += kStep) {
    std::fill(lowest_.begin(), lowest_.end(), std::int8_t{127});
    std::fill(highest_.begin(), highest_.end(), TsdfGrid::kUnknown);
    for (int row = y; row <= y + kStep; ++row) {
      for (int x = low_x; x <= high_x;) {
        const int piece = std::min(high_x + 1 - x, grid.size_cells() - (x & mask_));
        widen(grid.values() + grid.index(x, row), piece, lowest_.data() + (x - low_x), highest_.data() + (x - low_x));
        x += piece;
      }
    }
    const int side_bits = bits_ - kShift[0];
    std::uint8_t* const out =
        kind_[0].data() + (static_cast<std::size_t>((y & mask_) >> kShift[0]) << side_bits);
    for (int x = low_x; x < high_x; x += kStep) {
      const std::int8_t* const low = lowest_.data() + (x - low_x);
      const std::int8_t* const high = highest_.data() + (x - low_x);
      const bool free = *std::min_element(low, low + kStep + 1) > 0;
      const bool unknown = *std::max_element(high, high + kStep + 1) == TsdfGrid::kUnknown;
      out[(x & mask_) >> kShift[0]] = free ? kFree : unknown ? kUnknown : kMixed;
    }
  }
  for (int level = 1; level < levels_; ++level) {
    const int ratio = 1 << (kShift[level] - kShift[level - 1]);
    const int side = grid.size_cells() >> kShift[level], fine_side = grid.size_cells() >> kShift[level - 1];
    for (int y = 0; y < side; ++y) {
      for (int x = 0; x < side; ++x) {
        bool all = true;
        for (int j = 0; j < ratio * ratio && all; ++j) {
          all = kind_[level - 1][static_cast<std::size_t>((y * ratio + j / ratio) * fine_side + x * ratio +
                                                          j % ratio)] == kFree;
        }
        kind_[level][static_cast<std::size_t>(y * side + x)] = all ? kFree : kMixed;
      }
    }
  }
}

}  // namespace knav
