#include "planner_tracker/landmark_heuristic.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace knav {
namespace {

constexpr std::uint32_t kFar = std::numeric_limits<std::uint32_t>::max();

/// Dijkstra over the whole graph with a ring of 1 mm buckets (Dial): costs are integers and a move's is bounded.
class WholeGraph {
 public:
  explicit WholeGraph(const SearchGraph& graph) : graph_(graph), cost_mm(graph.size()) {
    std::uint32_t dearest = 0;
    for (int m = 0; m < kSearchMoves; ++m) dearest = std::max(dearest, graph.length_mm(m));
    const std::uint32_t worst_factor = graph.price().of(graph.price().hard_squared());
    std::size_t ring = 1;
    while (ring <= (static_cast<std::uint64_t>(dearest) * worst_factor >> 8) + 1) ring *= 2;
    ring_.resize(ring);
  }

  /// Costs from one node; kFar where it does not lead. Returns the node reached last, the farthest.
  std::size_t run(std::size_t from) {
    std::fill(cost_mm.begin(), cost_mm.end(), kFar);
    cost_mm[from] = 0;
    ring_[0].push_back(static_cast<std::uint32_t>(from));
    std::size_t waiting = 1, last = from;
    for (std::uint32_t now = 0; waiting > 0; ++now) {
      auto& bucket = ring_[now & (ring_.size() - 1)];
      while (!bucket.empty()) {
        const std::size_t node = bucket.back();
        bucket.pop_back();
        --waiting;
        if (cost_mm[node] != now) continue;
        last = node;
        const int jx = graph_.jx(node), jy = graph_.jy(node);
        const std::uint32_t factor = graph_.price().of(graph_.squared(jx, jy));
        for (int m = 0; m < kSearchMoves; ++m) {
          const std::uint32_t step = graph_.move_cost_mm(jx, jy, factor, m);
          if (step == 0) continue;
          const std::size_t to = graph_.node(jx + kSearchMove[m].dx, jy + kSearchMove[m].dy);
          if (now + step >= cost_mm[to]) continue;
          cost_mm[to] = now + step;
          ring_[(now + step) & (ring_.size() - 1)].push_back(static_cast<std::uint32_t>(to));
          ++waiting;
        }
      }
    }
    return last;
  }

 private:
  const SearchGraph& graph_;
  std::vector<std::vector<std::uint32_t>> ring_;

 public:
  std::vector<std::uint32_t> cost_mm;
};

/// A node of the largest connected part.
std::size_t node_of_largest_part(const SearchGraph& graph, bool* any) {
  std::vector<bool> seen(graph.size());
  std::vector<std::uint32_t> stack;
  std::size_t best_size = 0, best = 0;
  for (std::size_t first = 0; first < graph.size(); ++first) {
    if (seen[first] || !graph.price().open(graph.squared(graph.jx(first), graph.jy(first)))) continue;
    std::size_t size = 0;
    seen[first] = true;
    stack.push_back(static_cast<std::uint32_t>(first));
    while (!stack.empty()) {
      const std::size_t node = stack.back();
      stack.pop_back();
      ++size;
      const int jx = graph.jx(node), jy = graph.jy(node);
      for (int m = 0; m < 8; ++m) {
        if (graph.move_cost_mm(jx, jy, 256, m) == 0) continue;
        const std::size_t to = graph.node(jx + kSearchMove[m].dx, jy + kSearchMove[m].dy);
        if (seen[to]) continue;
        seen[to] = true;
        stack.push_back(static_cast<std::uint32_t>(to));
      }
    }
    if (size > best_size) {
      best_size = size;
      best = first;
    }
  }
  *any = best_size > 0;
  return best;
}

}  // namespace

void LandmarkHeuristic::build(const SearchGraph& graph) {
  table_.clear();
  active_count_ = 0;
  bool any = false;
  const std::size_t seed = node_of_largest_part(graph, &any);
  if (!any) return;
  table_.assign(graph.size() * kLandmarks, kUnreached);
  WholeGraph whole(graph);
  // Each landmark is the node farthest from those before it.
  std::size_t landmark = whole.run(seed);
  std::vector<std::uint32_t> nearest(graph.size(), kFar);
  for (int l = 0; l < kLandmarks; ++l) {
    const std::size_t farthest = whole.run(landmark);
    if (l == 0) {
      shift_ = 0;
      // Costs from elsewhere are at most twice the largest from here.
      while ((static_cast<std::uint64_t>(whole.cost_mm[farthest]) * 2 >> shift_) >= kUnreached) ++shift_;
    }
    std::size_t next = landmark;
    std::uint32_t next_mm = 0;
    for (std::size_t i = 0; i < graph.size(); ++i) {
      const std::uint32_t d = whole.cost_mm[i];
      if (d == kFar) continue;
      table_[i * kLandmarks + static_cast<std::size_t>(l)] = static_cast<std::uint16_t>(d >> shift_);
      nearest[i] = std::min(nearest[i], d);
      if (nearest[i] > next_mm) {
        next_mm = nearest[i];
        next = i;
      }
    }
    landmark = next;
  }
}

void LandmarkHeuristic::aim(std::size_t start, std::size_t goal) {
  active_count_ = 0;
  if (table_.empty()) return;
  const std::uint16_t* s = table_.data() + start * kLandmarks;
  const std::uint16_t* g = table_.data() + goal * kLandmarks;
  std::uint32_t best[kActive] = {};
  for (int l = 0; l < kLandmarks; ++l) {
    if (s[l] == kUnreached || g[l] == kUnreached) continue;
    std::uint32_t bound = s[l] > g[l] ? static_cast<std::uint32_t>(s[l] - g[l]) : static_cast<std::uint32_t>(g[l] - s[l]);
    int landmark = l;
    for (int i = 0; i < active_count_; ++i) {
      if (bound <= best[i]) continue;
      std::swap(bound, best[i]);
      std::swap(landmark, active_[i]);
    }
    if (active_count_ == kActive) continue;
    best[active_count_] = bound;
    active_[active_count_++] = landmark;
  }
  for (int i = 0; i < active_count_; ++i) goal_[i] = g[active_[i]];
}

}  // namespace knav
