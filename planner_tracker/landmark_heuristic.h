#pragma once

#include <cstdint>
#include <vector>

#include "planner_tracker/search_graph.h"

namespace knav {

/// Lower bounds on path costs from exact costs to a few far apart nodes: |d(L, a) - d(L, b)| <= d(a, b). Built once a
/// map; obstacles that appear later only make real costs larger, so it stays a bound unless something opens.
class LandmarkHeuristic {
 public:
  static constexpr int kLandmarks = 8;  ///< 16 bytes a node
  static constexpr int kActive = 3;     ///< the best of them serve one search

  void build(const SearchGraph& graph);
  bool ready() const { return !table_.empty(); }

  /// Chooses the landmarks that say most about this pair of nodes.
  void aim(std::size_t start, std::size_t goal);
  /// Lower bound [mm] from a node to the goal aimed at, 0 where nothing is known.
  std::uint32_t bound_mm(std::size_t node) const {
    const std::uint16_t* row = table_.data() + node * kLandmarks;
    std::uint32_t best = 0;
    for (int i = 0; i < active_count_; ++i) {
      const std::uint16_t d = row[active_[i]];
      if (d == kUnreached) return 0;
      const std::uint32_t difference = d > goal_[i] ? d - goal_[i] : goal_[i] - d;
      best = difference > best ? difference : best;
    }
    // Each of the two was rounded down by less than one unit.
    return best == 0 ? 0 : (best - 1) << shift_;
  }

 private:
  static constexpr std::uint16_t kUnreached = 65535;

  std::vector<std::uint16_t> table_;  ///< [node][landmark], units of 2^shift_ mm
  int shift_ = 0;
  int active_[kActive] = {};
  std::uint32_t goal_[kActive] = {};
  int active_count_ = 0;
};

}  // namespace knav
