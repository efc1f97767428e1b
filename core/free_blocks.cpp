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

/// Leaves in [k] the least and the largest of `distance` more columns.
KNAV_MULTIVERSION
void spread(int distance, int count, std::int8_t* lowest, std::int8_t* highest) {
  for (int k = 0; k + distance < count; ++k) {
    lowest[k] = lowest[k + distance] < lowest[k] ? lowest[k + distance] : lowest[k];
    highest[k] = highest[k + distance] > highest[k] ? highest[k + distance] : highest[k];
  }
}

/// One more than the least of three neighbours in a row beside it, where that is less.
KNAV_MULTIVERSION
void lower_by_row(const std::uint8_t* beside, unsigned count, std::uint8_t* rings) {
  for (unsigned k = 1; k + 1 < count; ++k) {
    std::uint8_t least = beside[k - 1] < beside[k] ? beside[k - 1] : beside[k];
    least = beside[k + 1] < least ? beside[k + 1] : least;
    const auto more = static_cast<std::uint8_t>(least + 1);
    rings[k] = more < rings[k] ? more : rings[k];
  }
}

}  // namespace

void FreeBlocks::build(const TsdfGrid& grid, double x_m, double y_m, double reach_m) {
  // Whole blocks that lie in the window: its last row and column of quads end outside.
  constexpr int kStep = 1 << kShift;
  const auto up = [](int i) { return (i + kStep - 1) & ~(kStep - 1); };
  const auto down = [](int i) { return i & ~(kStep - 1); };
  const int reach = static_cast<int>(reach_m / grid.resolution_m()) + kStep;
  const int last_x = grid.first_x() + grid.size_cells() - 1, last_y = grid.first_y() + grid.size_cells() - 1;
  low_x_ = std::max(up(grid.first_x()), down(grid.cell_of(x_m) - reach));
  low_y_ = std::max(up(grid.first_y()), down(grid.cell_of(y_m) - reach));
  width_ = static_cast<unsigned>(std::max(0, std::min(down(last_x), up(grid.cell_of(x_m) + reach)) - low_x_)) >> kShift;
  height_ = static_cast<unsigned>(std::max(0, std::min(down(last_y), up(grid.cell_of(y_m) + reach)) - low_y_)) >> kShift;
  if (width_ < 3 || height_ < 3) width_ = height_ = 0;
  rings_.resize(static_cast<std::size_t>(width_) * height_);
  unknown_.resize(rings_.size());
  for (unsigned row = 0; row < height_; ++row) classify_row(grid, row);
  count_rings();
}

void FreeBlocks::classify_row(const TsdfGrid& grid, unsigned row) {
  constexpr int kStep = 1 << kShift;
  // A block of quads stands on a row and a column of cells more.
  const int cells = static_cast<int>(width_) * kStep + 1, mask = grid.size_cells() - 1;
  lowest_.assign(static_cast<std::size_t>(cells), 127);
  highest_.assign(static_cast<std::size_t>(cells), TsdfGrid::kUnknown);
  const int low_y = low_y_ + static_cast<int>(row) * kStep;
  for (int iy = low_y; iy <= low_y + kStep; ++iy) {
    for (int k = 0; k < cells;) {
      const int ix = low_x_ + k;
      const int piece = std::min(cells - k, grid.size_cells() - (ix & mask));
      widen(grid.values() + grid.index(ix, iy), piece, lowest_.data() + k, highest_.data() + k);
      k += piece;
    }
  }
  for (const int distance : {1, 2, 4, 1}) spread(distance, cells, lowest_.data(), highest_.data());
  const std::size_t first = static_cast<std::size_t>(row) * width_;
  for (std::size_t b = 0; b < width_; ++b) {
    const std::size_t k = b << kShift;
    const bool free = lowest_[k] > 0, unknown = highest_[k] == TsdfGrid::kUnknown;
    rings_[first + b] = free || unknown ? kMostRings : 0;  // until their neighbours have been asked
    unknown_[first + b] = unknown ? kUnknown : 0;
  }
}

/// Chessboard distances in two passes (Rosenfeld and Pfaltz, Pattern Recognition 1968). What lies outside counts as mixed.
void FreeBlocks::count_rings() {
  if (rings_.empty()) return;
  const auto row = [&](unsigned y) { return rings_.data() + static_cast<std::size_t>(y) * width_; };
  const auto edge = [](std::uint8_t* rings) { *rings = std::min<std::uint8_t>(*rings, 1); };
  for (unsigned y = 0; y < height_; ++y) {
    for (const unsigned x : {0u, width_ - 1}) edge(row(y) + x);
  }
  for (unsigned x = 0; x < width_; ++x) {
    for (const unsigned y : {0u, height_ - 1}) edge(row(y) + x);
  }
  const auto lower = [](std::uint8_t beside, std::uint8_t* rings) {
    const auto more = static_cast<std::uint8_t>(beside + 1);
    *rings = std::min(*rings, more);
    return *rings;
  };
  for (unsigned y = 1; y + 1 < height_; ++y) {
    std::uint8_t* const now = row(y);
    lower_by_row(row(y - 1), width_, now);
    std::uint8_t left = now[0];
    for (unsigned x = 1; x + 1 < width_; ++x) left = lower(left, now + x);
  }
  for (unsigned y = height_ - 1; y-- > 1;) {
    std::uint8_t* const now = row(y);
    lower_by_row(row(y + 1), width_, now);
    std::uint8_t right = now[width_ - 1];
    for (unsigned x = width_ - 1; x-- > 1;) right = lower(right, now + x);
  }
  for (std::size_t i = 0; i < rings_.size(); ++i) rings_[i] = static_cast<std::uint8_t>(rings_[i] | unknown_[i]);
}

}  // namespace knav
