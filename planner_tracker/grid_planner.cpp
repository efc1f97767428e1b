#include "planner_tracker/grid_planner.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

#include "planner_tracker/grid_search.h"
#include "planner_tracker/path_shortener.h"

namespace knav {
namespace {

constexpr int kStride = 2;

}  // namespace

struct GridPlanner::Search {
  explicit Search(const PlannerTrackerConfig& c) : config(c) {}

  PlannerTrackerConfig config;
  ClearancePrice hard_price, keep_price;
  bool narrow = false;
  GridSearch coarse, fine;
  std::vector<Cell> cells, escape;
  std::vector<Point2> points;
  PathShortener shortener;
  const MapLayer* labelled = nullptr;  ///< the layer given to set_map
  /// Per cell: its connected part; 0 = closed, or one part too many. narrow_part only once it was needed.
  std::vector<std::uint16_t> part, narrow_part;

  const ClearancePrice& price() const { return narrow ? keep_price : hard_price; }
  static void label_parts(const MapLayer& layer, const ClearancePrice& price, std::vector<std::uint16_t>* part);
  bool apart(const MapLayer& layer, const Cell& a, const Cell& b) const;
  bool find_escape(const MapLayer& layer, const Cell& start, Cell* out);
  bool find_way(const MapLayer& layer, const Cell& start, const Cell& goal, PlanResult* result);
};

GridPlanner::GridPlanner(const PlannerTrackerConfig& config) : search_(std::make_unique<Search>(config)) {}
GridPlanner::~GridPlanner() = default;

/// Which open cells hang together: tells at once that no way leads to a goal.
void GridPlanner::Search::label_parts(const MapLayer& layer, const ClearancePrice& price, std::vector<std::uint16_t>* parts) {
  std::vector<std::uint16_t>& part = *parts;
  part.assign(layer.state.size(), 0);
  const SearchGraph graph(layer, price, 1);
  std::vector<std::uint32_t> stack;
  std::uint16_t label = 0;
  for (std::size_t first = 0; first < part.size() && label < 65535; ++first) {
    if (part[first] != 0 || !price.open(layer.squared[first])) continue;
    part[first] = ++label;
    stack.push_back(static_cast<std::uint32_t>(first));
    while (!stack.empty()) {
      const std::size_t cell = stack.back();
      stack.pop_back();
      const int ix = graph.jx(cell), iy = graph.jy(cell);
      for (int m = 0; m < kSearchMoves; ++m) {
        if (graph.move_cost_mm(ix, iy, 256, m) == 0) continue;
        const std::size_t to = graph.node(ix + kSearchMove[m].dx, iy + kSearchMove[m].dy);
        if (part[to] != 0) continue;
        part[to] = label;
        stack.push_back(static_cast<std::uint32_t>(to));
      }
    }
  }
}

bool GridPlanner::Search::apart(const MapLayer& layer, const Cell& a, const Cell& b) const {
  if (&layer != labelled) return false;
  const std::vector<std::uint16_t>& parts = narrow ? narrow_part : part;
  const std::uint16_t pa = parts[layer.geometry.index(a.ix, a.iy)], pb = parts[layer.geometry.index(b.ix, b.iy)];
  return pa != 0 && pb != 0 && pa != pb;
}

void GridPlanner::set_map(const MapLayer& layer) {
  const PlannerTrackerConfig& c = search_->config;
  Search& s = *search_;
  s.hard_price = ClearancePrice(layer, c.hard_radius_m(), c.preferred_radius_m(), c.clearance.price);
  s.keep_price = ClearancePrice(layer, c.keep_radius_m(), c.preferred_radius_m(), c.clearance.price);
  s.labelled = &layer;
  Search::label_parts(layer, s.hard_price, &s.part);
  s.narrow_part.clear();
  s.narrow = false;
}

void GridPlanner::set_narrow(bool narrow) {
  Search& s = *search_;
  s.narrow = narrow;
  if (narrow && s.narrow_part.empty() && s.labelled != nullptr) Search::label_parts(*s.labelled, s.keep_price, &s.narrow_part);
}

bool GridPlanner::narrow() const { return search_->narrow; }

/// Dijkstra from a closed cell through cells that never come nearer to something, to the first open one.
/// Cells under the robot may be anything: it stands there.
bool GridPlanner::Search::find_escape(const MapLayer& layer, const Cell& start, Cell* out) {
  escape.clear();
  const double resolution = layer.geometry.resolution_m;
  const int r = std::max(1, static_cast<int>(config.clearance.escape_m / resolution));
  const int under = static_cast<int>(0.5 * config.outline().inscribed_m() / resolution);
  const int side = 2 * r + 1;
  std::vector<float> cost(static_cast<std::size_t>(side * side), std::numeric_limits<float>::infinity());
  std::vector<int> parent(cost.size(), -1);
  const auto local = [&](int dx, int dy) { return static_cast<std::size_t>((dy + r) * side + dx + r); };
  using Entry = std::pair<float, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open_list;
  cost[local(0, 0)] = 0.0f;
  open_list.push({0.0f, static_cast<int>(local(0, 0))});
  while (!open_list.empty()) {
    const auto [c, at] = open_list.top();
    open_list.pop();
    if (c > cost[static_cast<std::size_t>(at)]) continue;
    const int dx = at % side - r, dy = at / side - r;
    const std::int16_t here = layer.squared_at(start.ix + dx, start.iy + dy);
    if (price().open(here)) {
      *out = {start.ix + dx, start.iy + dy};
      for (int n = at; n >= 0; n = parent[static_cast<std::size_t>(n)]) {
        escape.push_back({start.ix + n % side - r, start.iy + n / side - r});
      }
      std::reverse(escape.begin(), escape.end());
      return true;
    }
    for (int m = 0; m < 8; ++m) {
      const int tx = dx + kSearchMove[m].dx, ty = dy + kSearchMove[m].dy;
      if (tx * tx + ty * ty > r * r || !layer.geometry.contains(start.ix + tx, start.iy + ty)) continue;
      const std::int16_t there = layer.squared_at(start.ix + tx, start.iy + ty);
      if (there < here || (there == 0 && tx * tx + ty * ty > under * under)) continue;
      const float next = c + static_cast<float>(kSearchMove[m].length);
      if (next >= cost[local(tx, ty)]) continue;
      cost[local(tx, ty)] = next;
      parent[local(tx, ty)] = at;
      open_list.push({next, static_cast<int>(local(tx, ty))});
    }
  }
  return false;
}

bool GridPlanner::Search::find_way(const MapLayer& layer, const Cell& start, const Cell& goal,
                                   PlanResult* result) {
  if (apart(layer, start, goal)) {
    result->at = {layer.geometry.center_x_m(goal.ix), layer.geometry.center_y_m(goal.iy)};
    return false;
  }
  Cell nearest;
  bool found = coarse.find(SearchGraph(layer, price(), kStride), start, goal, &cells, &nearest);
  result->expanded += coarse.expanded();
  if (!found) {
    // A gap that lies between the coarse nodes.
    found = fine.find(SearchGraph(layer, price(), 1), start, goal, &cells, &nearest);
    result->expanded += fine.expanded();
  }
  if (!found) result->at = {layer.geometry.center_x_m(nearest.ix), layer.geometry.center_y_m(nearest.iy)};
  return found;
}

void GridPlanner::plan(const MapLayer& layer, const Point2& start, const Point2& goal, PlanResult* result) {
  Search& s = *search_;
  result->path.clear();
  result->expanded = 0;
  result->length_m = result->cost_m = 0.0;
  const GridGeometry& g = layer.geometry;
  Cell from{g.cell_x(start.x_m), g.cell_y(start.y_m)};
  const Cell to{g.cell_x(goal.x_m), g.cell_y(goal.y_m)};
  if (!s.price().open(layer.squared_at(to.ix, to.iy))) {
    result->at = goal;
    result->code = PlanCode::kGoalUnknown;
    if (layer.at(to.ix, to.iy) == CellState::kUnknown) return;
    // Not unknown itself: what is too near, the nearest thing first?
    const int r = static_cast<int>(std::ceil(s.config.hard_radius_m() / g.resolution_m)) + 1;
    int best = std::numeric_limits<int>::max();
    for (int dy = -r; dy <= r; ++dy) {
      for (int dx = -r; dx <= r; ++dx) {
        const CellState state = layer.at(to.ix + dx, to.iy + dy);
        if (state == CellState::kFree || dx * dx + dy * dy >= best) continue;
        best = dx * dx + dy * dy;
        result->at = {g.center_x_m(to.ix + dx), g.center_y_m(to.iy + dy)};
        result->code = state == CellState::kUnknown ? PlanCode::kGoalUnknown : PlanCode::kGoalOccupied;
      }
    }
    return;
  }
  s.escape.clear();
  if (!s.price().open(layer.squared_at(from.ix, from.iy)) && !s.find_escape(layer, from, &from)) {
    result->code = PlanCode::kStartBlocked;
    result->at = start;
    return;
  }
  if (!s.find_way(layer, from, to, result)) {
    result->code = PlanCode::kNoPath;
    return;
  }
  result->code = PlanCode::kOk;
  s.points.clear();
  for (const Cell& cell : s.cells) s.points.push_back({g.center_x_m(cell.ix), g.center_y_m(cell.iy)});
  if (s.escape.empty()) s.points.front() = start;
  s.points.back() = goal;
  s.shortener.shorten(layer, s.price(), &s.points);
  if (!s.escape.empty()) {
    result->path.push_back(start);
    for (std::size_t i = 1; i + 1 < s.escape.size(); ++i) {
      result->path.push_back({g.center_x_m(s.escape[i].ix), g.center_y_m(s.escape[i].iy)});
    }
  }
  result->path.insert(result->path.end(), s.points.begin(), s.points.end());
  for (std::size_t i = 1; i < result->path.size(); ++i) {
    const Point2 &a = result->path[i - 1], &b = result->path[i];
    const double length = std::hypot(b.x_m - a.x_m, b.y_m - a.y_m);
    const double cost = s.shortener.segment_cost_m(layer, s.price(), a, b);
    result->length_m += length;
    // Parts of an escape are dear, not impossible.
    result->cost_m += std::isfinite(cost) ? cost : length * (1.0 + 2.0 * s.config.clearance.price);
  }
}

double GridPlanner::segment_cost_m(const MapLayer& layer, const Point2& from, const Point2& to) const {
  return search_->shortener.segment_cost_m(layer, search_->price(), from, to);
}

double GridPlanner::kept_cost_m(const MapLayer& layer, const Point2& from, const Point2& to) const {
  return search_->shortener.segment_cost_m(layer, search_->keep_price, from, to);
}

bool GridPlanner::open(const MapLayer& layer, const Point2& point) const {
  return search_->price().open(
      layer.squared_at(layer.geometry.cell_x(point.x_m), layer.geometry.cell_y(point.y_m)));
}

bool GridPlanner::kept_open(const MapLayer& layer, const Point2& point) const {
  return search_->keep_price.open(
      layer.squared_at(layer.geometry.cell_x(point.x_m), layer.geometry.cell_y(point.y_m)));
}

bool GridPlanner::nearest_open(const MapLayer& layer, const Point2& point, double within_m,
                               Point2* found) const {
  const GridGeometry& g = layer.geometry;
  const int cx = g.cell_x(point.x_m), cy = g.cell_y(point.y_m);
  const int r = static_cast<int>(within_m / g.resolution_m);
  int best = r * r + 1;
  for (int dy = -r; dy <= r; ++dy) {
    for (int dx = -r; dx <= r; ++dx) {
      if (dx * dx + dy * dy >= best || !search_->price().open(layer.squared_at(cx + dx, cy + dy))) continue;
      best = dx * dx + dy * dy;
      *found = {g.center_x_m(cx + dx), g.center_y_m(cy + dy)};
    }
  }
  return best <= r * r;
}

}  // namespace knav
