#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

namespace knav {

/// A depth buffer of one image row: the greatest inverse depth of each column, and whose it is.
///
/// What is drawn only ever comes nearer. So the least inverse depth of a block of columns, known from some time ago, still is a bound:
/// what is no nearer than that all over its columns cannot show, and need not be drawn (a hierarchical depth buffer, Greene, Kass and
/// Miller 1993, of two levels and one row).
class RowBuffer {
 public:
  explicit RowBuffer(int width)
      : width_(width),
        inverse_z_(blocks_for(width) * kBlock),
        owner_(inverse_z_.size()),
        block_least_(blocks_for(width)),
        block_stale_(blocks_for(width)) {}

  void clear() {
    std::fill(inverse_z_.begin(), inverse_z_.begin() + width_, 0.0f);
    std::fill(inverse_z_.begin() + width_, inverse_z_.end(), std::numeric_limits<float>::infinity());
    std::fill(owner_.begin(), owner_.end(), -1);
    std::fill(block_least_.begin(), block_least_.end(), 0.0f);
    std::fill(block_stale_.begin(), block_stale_.end(), static_cast<std::uint8_t>(0));
  }

  /// True if something of at most this inverse depth cannot show in columns begin ... end - 1. May say false where it cannot either.
  bool hides(int begin, int end, float inverse_z) {
    if (begin >= end) return true;
    for (int b = begin / kBlock; b <= (end - 1) / kBlock; ++b) {
      const auto block = static_cast<std::size_t>(b);
      if (block_least_[block] >= inverse_z) continue;
      if (!block_stale_[block]) return false;
      block_least_[block] = least_of(block);
      block_stale_[block] = 0;
      if (block_least_[block] < inverse_z) return false;
    }
    return true;
  }

  /// Columns begin ... end - 1 with inverse depth at_u0 + (u - u0) slope, where that is nearer than what is there.
  void draw(int begin, int end, float at_u0, float u0, float slope, std::int32_t owner) {
    if (begin >= end) return;
    float* __restrict z = inverse_z_.data();
    std::int32_t* __restrict of = owner_.data();
    for (int u = begin; u < end; ++u) {
      const float value = at_u0 + (static_cast<float>(u) - u0) * slope, before = z[u];
      const std::int32_t owned = of[u], mask = -static_cast<std::int32_t>(value > before);
      z[u] = value > before ? value : before;
      of[u] = (owner & mask) | (owned & ~mask);
    }
    for (int b = begin / kBlock; b <= (end - 1) / kBlock; ++b) block_stale_[static_cast<std::size_t>(b)] = 1;
  }

  float inverse_z(int u) const { return inverse_z_[static_cast<std::size_t>(u)]; }
  /// -1 where nothing was drawn
  std::int32_t owner(int u) const { return owner_[static_cast<std::size_t>(u)]; }

 private:
  static constexpr int kBlock = 16, kLanes = 8;
  static std::size_t blocks_for(int width) { return static_cast<std::size_t>((width + kBlock - 1) / kBlock); }

  float least_of(std::size_t block) const {
    const float* z = inverse_z_.data() + block * kBlock;
    std::array<float, kLanes> least;
    for (int k = 0; k < kLanes; ++k) least[static_cast<std::size_t>(k)] = std::min(z[k], z[k + kLanes]);
    return *std::min_element(least.begin(), least.end());
  }

  int width_;
  std::vector<float> inverse_z_;
  std::vector<std::int32_t> owner_;
  std::vector<float> block_least_;         ///< a bound from below
  std::vector<std::uint8_t> block_stale_;  ///< drawn in since
};

}  // namespace knav
