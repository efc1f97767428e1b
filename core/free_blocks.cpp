#include "core/free_blocks.h"

#include <algorithm>

#include "core/multiversion.h"

namespace knav {
namespace {

constexpr std::uint32_t kSigns = 0x80808080u;  // set in a corner that is negative or unknown
constexpr std::uint32_t kAllUnknown = 0x80808080u;

KNAV_MULTIVERSION
void gather_bits(const std::uint32_t* quad, int count, std::uint32_t* bad, std::uint32_t* known) {
  for (int k = 0; k < count; ++k) {
    bad[k] |= (quad[k] & kSigns) | (quad[k] == 0 ? 1u : 0u);
    known[k] |= quad[k] ^ kAllUnknown;
  }
}

}  // namespace

void FreeBlocks::build(const TsdfGrid& grid, double x_m, double y_m, double reach_m) {
  bits_ = grid.bits();
  mask_ = grid.size_cells() - 1;
  for (int level = 0; level < kLevels; ++level) {
    const int side = std::max(1, grid.size_cells() >> kShift[level]);
    kind_[level].assign(static_cast<std::size_t>(side) * static_cast<std::size_t>(side), 0);
  }
  if (grid.size_cells() < (1 << kShift[kLevels - 1])) return;
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
  bad_.resize(static_cast<std::size_t>(high_x - low_x));
  known_.resize(bad_.size());
  for (int y = low_y; y < high_y; y += kStep) {
    std::fill(bad_.begin(), bad_.end(), 0u);
    std::fill(known_.begin(), known_.end(), 0u);
    for (int row = y; row < y + kStep; ++row) {
      for (int x = low_x; x < high_x;) {
        const int piece = std::min(high_x - x, grid.size_cells() - (x & mask_));
        gather_bits(grid.quads() + grid.quad_index(x, row), piece, bad_.data() + (x - low_x),
                    known_.data() + (x - low_x));
        x += piece;
      }
    }
    const int side_bits = bits_ - kShift[0];
    std::uint8_t* const out =
        kind_[0].data() + (static_cast<std::size_t>((y & mask_) >> kShift[0]) << side_bits);
    for (int x = low_x; x < high_x; x += kStep) {
      std::uint32_t bad = 0, known = 0;
      for (int j = 0; j < kStep; ++j) {
        bad |= bad_[static_cast<std::size_t>(x - low_x + j)];
        known |= known_[static_cast<std::size_t>(x - low_x + j)];
      }
      out[(x & mask_) >> kShift[0]] = bad == 0 ? kFree : known == 0 ? kUnknown : kMixed;
    }
  }
  for (int level = 1; level < kLevels; ++level) {
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
