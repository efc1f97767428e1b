#pragma once

#include <cstdint>
#include <vector>

#include "planner_tracker/search_graph.h"

namespace knav {

/// A cell of the map.
struct Cell {
  int ix = 0, iy = 0;
};

/// A* between two open cells over a SearchGraph. Buffers are kept from search to search.
class GridSearch {
 public:
  /// @param cells  of the way found, ends included, neighbours at most two nodes apart
  /// @param nearest  if nothing leads to the goal: of the cells looked at, that which lies nearest to it
  bool find(const SearchGraph& graph, const Cell& start, const Cell& goal, std::vector<Cell>* cells,
            Cell* nearest);
  int expanded() const { return expanded_; }

 private:
  struct Node {
    std::uint32_t g_mm, h_mm, search, parent;
  };
  struct Open {
    std::uint32_t node, g_mm;
  };
  static constexpr std::uint32_t kNoParent = 0xFFFFFFFFu;
  static constexpr std::uint32_t kBucketShift = 4;  ///< 16 mm: ten buckets a move
  static constexpr std::uint32_t kBuckets = 1024;
  static constexpr int kFloodAfter = 3000;  ///< expanded nodes

  void open(std::size_t node, std::uint32_t g_mm, std::uint32_t parent, std::uint32_t h_mm);
  /// Grows a region round the goal beside a search that takes long: a goal behind a closed door is known to
  /// be out of reach once its room is full, long before all the rest of the building was searched.
  enum class Flood { kGrowing, kMetSearch, kFull };
  void start_flood(const SearchGraph& graph, const Cell& goal);
  Flood grow_flood(const SearchGraph& graph);

  std::vector<Node> nodes_;
  std::vector<std::vector<Open>> ring_;
  std::vector<std::uint32_t> flood_;  ///< per node: the search whose flood holds it
  std::vector<std::uint32_t> flood_stack_;
  std::uint32_t search_ = 0;
  std::uint32_t bucket_ = 0;  ///< of the smallest f
  std::size_t waiting_ = 0;
  int expanded_ = 0;
};

}  // namespace knav
