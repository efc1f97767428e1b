// ClosureFinder's part that knows which places are worth comparing.
#include <algorithm>
#include <cmath>
#include <queue>

#include "global_map_builder/closure_finder.h"

namespace knav {

/// The shortest way between two keyframes along the drives and over the closures accepted so far: what error
/// can have gathered between them.
double ClosureFinder::drift_path_m(int from, int to) const {
  const auto nodes = static_cast<std::size_t>(set_.nodes());
  std::vector<std::vector<int>> jumps(nodes);
  for (const Closure& closure : closures_) {
    if (!closure.accepted) continue;
    jumps[static_cast<std::size_t>(closure.from)].push_back(closure.to);
    jumps[static_cast<std::size_t>(closure.to)].push_back(closure.from);
  }
  std::vector<double> best(nodes, 1e300);
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> open;
  const auto reach = [&](int node, double length) {
    double& known = best[static_cast<std::size_t>(node)];
    if (length < known) open.emplace(known = length, node);
  };
  const auto step = [&](int node, int next, double length) {
    if (next < 0 || next >= set_.nodes() || set_.drive_of(node) != set_.drive_of(next)) return;
    // What is held is known: no drift gathers along it.
    const double way = held(node) && held(next) ? 0.0 : std::fabs(path_m(node) - path_m(next));
    reach(next, length + way);
  };
  reach(from, 0.0);
  while (!open.empty()) {
    const auto [length, node] = open.top();
    open.pop();
    const auto i = static_cast<std::size_t>(node);
    if (node == to) return length;
    if (length > best[i]) continue;
    step(node, node - 1, length);
    step(node, node + 1, length);
    for (const int other : jumps[i]) reach(other, length);
  }
  return path_m(set_.nodes() - 1);
}

MatchWindow ClosureFinder::window_for(double path_m) const {
  const ClosureConfig& c = config_.closures;
  MatchWindow window;
  window.radius_m = std::min(c.search_max_m, c.search_base_m + c.search_per_m * path_m);
  window.angle_rad =
      std::min(c.search_angle_max_deg, c.search_angle_base_deg + c.search_angle_deg_per_m * path_m) * kPi /
      180.0;
  return window;
}

/// Of every earlier pass by this place, the keyframe that was nearest.
std::vector<int> ClosureFinder::earlier_visits(int keyframe, int lowest) const {
  const Pose2& here = graph_.nodes.at(keyframe);
  const double here_path_m = path_m(keyframe);
  std::vector<int> visits;
  int nearest = -1;
  double nearest_distance = 0.0, left_at_path = 0.0;
  const auto finish = [&] {
    if (nearest >= 0) visits.push_back(nearest);
    nearest = -1;
  };
  for (int other = lowest; other < keyframe; ++other) {
    const double other_path = path_m(other);
    if (here_path_m - other_path < config_.closures.min_path_m) break;
    const double distance = distance_m(here, graph_.nodes.at(other));
    const double limit = config_.closures.nearest_m + window_for(here_path_m - other_path).radius_m;
    if (distance > limit) continue;
    if (nearest >= 0 && other_path - left_at_path > config_.closures.nearest_m) finish();
    if (nearest < 0 || distance < nearest_distance) {
      nearest = other;
      nearest_distance = distance;
    }
    left_at_path = other_path;
    // A long pass in a small place is split, so that no visit hides behind another.
    if (other_path - path_m(nearest) > 2.0 * config_.closures.nearest_m) finish();
  }
  finish();
  return visits;
}

bool ClosureFinder::tried(int from, int to, const Pose2& prior) const {
  const auto attempt = attempts_.find({from, to});
  return attempt != attempts_.end() &&
         distance_m(attempt->second.prior, prior) < 0.5 * attempt->second.radius_m;
}

void ClosureFinder::pair_buttons(int drive, int lowest) {
  std::vector<int> marks;
  for (int node = lowest; node < set_.first(drive + 1); ++node) {
    if (set_.keyframe(node).marked) marks.push_back(node);
  }
  for (std::size_t b = 1; b < marks.size(); ++b) {
    if (marks[b] < set_.first(drive)) continue;
    // The earlier mark nearest in the estimate, if it can be the same place at all.
    int nearest = -1;
    double nearest_distance = 0.0;
    for (std::size_t a = 0; a < b; ++a) {
      const double distance = distance_m(graph_.nodes.at(marks[a]), graph_.nodes.at(marks[b]));
      if (path_m(marks[b]) - path_m(marks[a]) < 2.0 ||
          distance > window_for(drift_path_m(marks[a], marks[b])).radius_m) {
        continue;
      }
      if (nearest < 0 || distance < nearest_distance) {
        nearest = marks[a];
        nearest_distance = distance;
      }
    }
    if (nearest < 0 || attempts_.count({nearest, marks[b]}) > 0) continue;
    Closure closure;
    closure.from = nearest;
    closure.to = marks[b];
    closure.source = "button";
    add(closure, graph_.nodes.at(nearest).inverse() * graph_.nodes.at(marks[b]));
  }
}

void ClosureFinder::search_from(int keyframe, int lowest) {
  const std::vector<int> visits = earlier_visits(keyframe, lowest);
  const auto near = [&](int visit, const Pose2& prior) {
    return distance_m(prior, {}) <= config_.closures.nearest_m + window_for(drift_path_m(visit, keyframe)).radius_m;
  };
  std::vector<int> compared = {keyframe};
  for (const int visit : visits) {
    const Pose2 prior = graph_.nodes.at(visit).inverse() * graph_.nodes.at(keyframe);
    if (!tried(visit, keyframe, prior) && near(visit, prior)) compared.push_back(visit);
  }
  if (compared.size() > 1) prepare_submaps(compared);
  for (const int visit : visits) {
    const Pose2 prior = graph_.nodes.at(visit).inverse() * graph_.nodes.at(keyframe);
    if (tried(visit, keyframe, prior) || !near(visit, prior)) continue;
    const bool there = std::any_of(closures_.begin(), closures_.end(),
                                   [&](const Closure& c) { return c.from == visit && c.to == keyframe; });
    if (there) continue;
    Closure closure;
    closure.from = visit;
    closure.to = keyframe;
    closure.source = "automatic";
    add(closure, prior);
  }
}

void ClosureFinder::search(int drive, int lowest) {
  const int first = set_.first(drive), last = set_.first(drive + 1);
  for (int pass = 0; pass < config_.closures.passes; ++pass) {
    const std::size_t before = closures_.size();
    double next_path_m = 0.0;
    for (int node = first; node < last; ++node) {
      progress_((pass + static_cast<double>(node - first) / (last - first)) / config_.closures.passes);
      const double here_m = set_.keyframe(node).path_m;
      if (here_m < next_path_m) continue;
      next_path_m = here_m + config_.closures.submap_spacing_m;
      search_from(node, lowest);
    }
    if (pass > 0 && closures_.size() == before) break;
  }
}

}  // namespace knav
