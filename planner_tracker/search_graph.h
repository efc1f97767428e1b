#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "planner_tracker/combined_map.h"

namespace knav {

/// What driving over a cell costs, by its clearance: 256 = its length, 0 = closed.
class ClearancePrice {
 public:
  ClearancePrice() = default;
  /// @param hard_m centre to obstacle, closed below; @param preferred_m dearer below, by up to `price`
  ClearancePrice(const MapLayer& layer, double hard_m, double preferred_m, double price);

  std::uint32_t of(std::int16_t squared) const {
    return factor_[static_cast<std::size_t>(squared)];
  }
  bool open(std::int16_t squared) const { return squared >= hard_squared_; }
  std::int16_t hard_squared() const { return hard_squared_; }

 private:
  std::vector<std::uint32_t> factor_;
  std::int16_t hard_squared_ = 1;
};

/// One of the moves from a node, in nodes.
struct SearchMove {
  int dx, dy;
  double length;  ///< in nodes
};
constexpr int kSearchMoves = 16;
/// Eight neighbours, then the eight knight's moves: paths at most 2.8 % longer than straight before they are
/// pulled straight, instead of 8.2 %; it chooses between ways round an obstacle better.
extern const SearchMove kSearchMove[kSearchMoves];

/// The cells every `stride`-th of which is a node, as a graph of 16 neighbours with costs in mm.
class SearchGraph {
 public:
  SearchGraph() = default;
  SearchGraph(const MapLayer& layer, const ClearancePrice& price, int stride);

  int width() const { return width_; }
  int height() const { return height_; }
  int stride() const { return stride_; }
  std::size_t size() const { return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_); }
  std::size_t node(int jx, int jy) const {
    return static_cast<std::size_t>(jy) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(jx);
  }
  int jx(std::size_t node) const { return static_cast<int>(node % static_cast<std::size_t>(width_)); }
  int jy(std::size_t node) const { return static_cast<int>(node / static_cast<std::size_t>(width_)); }
  std::size_t cell(int jx, int jy) const { return layer_->geometry.index(jx * stride_, jy * stride_); }
  std::int16_t squared(int jx, int jy) const { return layer_->squared[cell(jx, jy)]; }
  const MapLayer& layer() const { return *layer_; }
  const ClearancePrice& price() const { return *price_; }

  /// Cost [mm] of a move between open nodes; 0 = not possible (off the grid, or the way or the end is
  /// closed).
  std::uint32_t move_cost_mm(int jx, int jy, std::uint32_t from_factor, int move) const {
    const int tx = jx + kSearchMove[move].dx, ty = jy + kSearchMove[move].dy;
    if (tx < 0 || ty < 0 || tx >= width_ || ty >= height_) return 0;
    const std::int16_t* d = layer_->squared.data() + cell(jx, jy);
    const std::uint32_t to_factor = price_->of(d[end_[move]]);
    if (to_factor == 0) return 0;
    for (int i = 0; i < between_count_[move]; ++i) {
      if (!price_->open(d[between_[move][i]])) return 0;
    }
    return (length_mm_[move] * (from_factor + to_factor)) >> 9;
  }
  std::uint32_t length_mm(int move) const { return length_mm_[move]; }

 private:
  const MapLayer* layer_ = nullptr;
  const ClearancePrice* price_ = nullptr;
  int stride_ = 1, width_ = 0, height_ = 0;
  std::uint32_t length_mm_[kSearchMoves] = {};
  std::ptrdiff_t end_[kSearchMoves] = {};
  std::ptrdiff_t between_[kSearchMoves][4] = {};  ///< cells a move passes over, as offsets
  int between_count_[kSearchMoves] = {};
};

}  // namespace knav
