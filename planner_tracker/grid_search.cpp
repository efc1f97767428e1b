#include "planner_tracker/grid_search.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace knav {

void GridSearch::open(std::size_t node, std::uint32_t g_mm, std::uint32_t parent, std::uint32_t h_mm) {
  nodes_[node] = {g_mm, h_mm, search_, parent};
  // Rounding makes f step back a little now and then; a node opened again later repairs that.
  const std::uint32_t bucket = std::clamp((g_mm + h_mm) >> kBucketShift, bucket_, bucket_ + kBuckets - 1);
  ring_[bucket % kBuckets].push_back({static_cast<std::uint32_t>(node), g_mm});
  ++waiting_;
}

void GridSearch::start_flood(const SearchGraph& graph, const Cell& goal) {
  if (flood_.size() != graph.size()) flood_.assign(graph.size(), 0);
  flood_stack_.clear();
  const int stride = graph.stride(), reach = stride - 1;
  for (int jy = (goal.iy - reach + stride - 1) / stride; jy * stride <= goal.iy + reach; ++jy) {
    for (int jx = (goal.ix - reach + stride - 1) / stride; jx * stride <= goal.ix + reach; ++jx) {
      if (jx < 0 || jy < 0 || jx >= graph.width() || jy >= graph.height()) continue;
      if (!graph.price().open(graph.squared(jx, jy))) continue;
      flood_[graph.node(jx, jy)] = search_;
      flood_stack_.push_back(static_cast<std::uint32_t>(graph.node(jx, jy)));
    }
  }
}

GridSearch::Flood GridSearch::grow_flood(const SearchGraph& graph) {
  if (flood_stack_.empty()) return Flood::kFull;
  const std::size_t node = flood_stack_.back();
  flood_stack_.pop_back();
  if (nodes_[node].search == search_) return Flood::kMetSearch;
  const int jx = graph.jx(node), jy = graph.jy(node);
  for (int m = 0; m < kSearchMoves; ++m) {
    if (graph.move_cost_mm(jx, jy, 256, m) == 0) continue;
    const std::size_t to = graph.node(jx + kSearchMove[m].dx, jy + kSearchMove[m].dy);
    if (flood_[to] == search_) continue;
    flood_[to] = search_;
    flood_stack_.push_back(static_cast<std::uint32_t>(to));
  }
  return Flood::kGrowing;
}

bool GridSearch::find(const SearchGraph& graph, const Cell& start, const Cell& goal, std::vector<Cell>* cells,
                      Cell* nearest) {
  expanded_ = 0;
  cells->clear();
  *nearest = start;
  const int stride = graph.stride();
  if (nodes_.size() != graph.size()) nodes_.assign(graph.size(), Node{0, 0, 0, kNoParent});
  if (ring_.empty()) ring_.resize(kBuckets);
  for (auto& bucket : ring_) bucket.clear();
  waiting_ = 0;
  if (++search_ == 0) {
    for (Node& node : nodes_) node.search = 0;
    std::fill(flood_.begin(), flood_.end(), 0);
    search_ = 1;
  }

  const double cell_mm = 1000.0 * graph.layer().geometry.resolution_m;
  const auto bound_mm = [&](int jx, int jy) {
    const double dx = jx * stride - goal.ix, dy = jy * stride - goal.iy;
    // 0.5 % below: lengths of moves are rounded to whole millimetres.
    return static_cast<std::uint32_t>(0.995 * cell_mm * std::sqrt(dx * dx + dy * dy));
  };

  // Nodes within a cell of the start (on every second cell: one, two or four), and likewise of the goal.
  const int reach = stride - 1;
  std::uint32_t lowest = std::numeric_limits<std::uint32_t>::max();
  for (int pass = 0; pass < 2; ++pass) {
    for (int jy = (start.iy - reach + stride - 1) / stride; jy * stride <= start.iy + reach; ++jy) {
      for (int jx = (start.ix - reach + stride - 1) / stride; jx * stride <= start.ix + reach; ++jx) {
        if (jx < 0 || jy < 0 || jx >= graph.width() || jy >= graph.height()) continue;
        if (!graph.price().open(graph.squared(jx, jy))) continue;
        const double length = std::hypot(jx * stride - start.ix, jy * stride - start.iy) * cell_mm;
        const auto g = static_cast<std::uint32_t>(length);
        const std::uint32_t h = bound_mm(jx, jy);
        if (pass == 0)
          lowest = std::min(lowest, (g + h) >> kBucketShift);
        else
          open(graph.node(jx, jy), g, kNoParent, h);
      }
    }
    bucket_ = lowest;
  }

  double nearest_squared = std::numeric_limits<double>::infinity();
  std::size_t end = 0;
  bool found = false;
  bool flooding = false;
  while (waiting_ > 0 && !found) {
    auto& bucket = ring_[bucket_ % kBuckets];
    if (bucket.empty()) {
      ++bucket_;
      continue;
    }
    const Open top = bucket.back();
    bucket.pop_back();
    --waiting_;
    const Node node = nodes_[top.node];
    if (node.g_mm != top.g_mm) continue;
    if (++expanded_ == kFloodAfter) {
      start_flood(graph, goal);
      flooding = true;
    }
    if (flooding) {
      const Flood flood = grow_flood(graph);
      if (flood == Flood::kFull) break;
      flooding = flood == Flood::kGrowing;
    }
    const int jx = graph.jx(top.node), jy = graph.jy(top.node);
    const int gx = jx * stride - goal.ix, gy = jy * stride - goal.iy;
    if (std::abs(gx) <= reach && std::abs(gy) <= reach) {
      end = top.node;
      found = true;
      break;
    }
    const double squared = static_cast<double>(gx) * gx + static_cast<double>(gy) * gy;
    if (squared < nearest_squared) {
      nearest_squared = squared;
      *nearest = {jx * stride, jy * stride};
    }
    const std::uint32_t factor = graph.price().of(graph.squared(jx, jy));
    for (int m = 0; m < kSearchMoves; ++m) {
      const std::uint32_t step = graph.move_cost_mm(jx, jy, factor, m);
      if (step == 0) continue;
      const int tx = jx + kSearchMove[m].dx, ty = jy + kSearchMove[m].dy;
      const std::size_t to = graph.node(tx, ty);
      const std::uint32_t g = node.g_mm + step;
      const bool seen = nodes_[to].search == search_;
      if (seen && nodes_[to].g_mm <= g) continue;
      open(to, g, top.node, seen ? nodes_[to].h_mm : bound_mm(tx, ty));
    }
  }
  if (!found) return false;
  for (std::uint32_t n = static_cast<std::uint32_t>(end); n != kNoParent; n = nodes_[n].parent) {
    cells->push_back({graph.jx(n) * stride, graph.jy(n) * stride});
  }
  cells->push_back(start);
  std::reverse(cells->begin(), cells->end());
  cells->push_back(goal);
  return true;
}

}  // namespace knav
