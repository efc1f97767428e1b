#include "global_map_builder/closure_finder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <queue>

#include "core/random.h"

namespace knav {
namespace {

constexpr std::size_t kPicturePoints = 600;  // of each local map, kept for the report

std::vector<SurfacePoint> thinned(const std::vector<SurfacePoint>& points) {
  std::vector<SurfacePoint> out;
  const std::size_t stride = points.size() / kPicturePoints + 1;
  for (std::size_t i = 0; i < points.size(); i += stride) out.push_back(points[i]);
  return out;
}

}  // namespace

DriveSet::DriveSet(const std::vector<Drive>& drives) : drives_(drives), first_{0} {
  double before_m = 0.0;
  for (const Drive& drive : drives) {
    first_.push_back(first_.back() + static_cast<int>(drive.keyframes.size()));
    path_before_m_.push_back(before_m);
    before_m += drive.keyframes.empty() ? 0.0 : drive.keyframes.back().path_m;
  }
}

int DriveSet::drive_of(int node) const {
  return static_cast<int>(std::upper_bound(first_.begin(), first_.end(), node) - first_.begin()) - 1;
}

ClosureFinder::ClosureFinder(const MapBuilderConfig& config, const DriveSet& set)
    : config_(config), set_(set) {
  for (int node = 0; node < set.nodes(); ++node) graph_.nodes[node] = set.keyframe(node).T_drive_base;
  for (int drive = 0; drive < set.count(); ++drive) {
    for (PoseGraphEdge edge : set.drives()[static_cast<std::size_t>(drive)].edges) {
      edge.from += set.first(drive);
      edge.to += set.first(drive);
      graph_.edges.push_back(edge);
    }
  }
}

void ClosureFinder::hold(const std::vector<Pose2>& T_map_keyframe, const std::vector<Closure>& closures) {
  held_ = static_cast<int>(T_map_keyframe.size());
  for (int node = 0; node < held_; ++node) {
    graph_.nodes[node] = T_map_keyframe[static_cast<std::size_t>(node)];
    graph_.held.insert(node);
  }
  for (const Closure& closure : closures) {
    if (closure.accepted) {
      graph_.edges.push_back(
          {closure.from, closure.to, closure.match.T_from_to, closure.match.information, true});
    }
    closures_.push_back(closure);
  }
}

void ClosureFinder::make_submap(int keyframe) {
  SurfaceConfig surface = config_.surface;
  surface.range_max_m = std::min(surface.range_max_m, config_.closures.submap_range_max_m);
  surface.min_looks = 2;
  submaps_.at(keyframe) = std::make_unique<Submap>(
      surface, observations_near(set_.drive(keyframe), keyframe - set_.first(set_.drive_of(keyframe)),
                                 config_.closures.submap_half_length_m, surface.limits()));
}

const Submap& ClosureFinder::submap(int keyframe) {
  if (submaps_.try_emplace(keyframe).second || !submaps_.at(keyframe)) make_submap(keyframe);
  return *submaps_.at(keyframe);
}

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

/// The entry of the list that keeps a closure out: its own, or that of a neighbouring pair with the same
/// mistake.
const ClosureVerdict* ClosureFinder::denied(const Closure& closure) const {
  for (const ClosureVerdict& v : verdicts_) {
    if (!v.allow && v.from == closure.from && v.to == closure.to) return &v;
  }
  for (const ClosureVerdict& v : verdicts_) {
    if (v.allow) continue;
    if (!v.has_transform || set_.drive_of(v.from) != set_.drive_of(closure.from) ||
        set_.drive_of(v.to) != set_.drive_of(closure.to) ||
        std::fabs(path_m(v.from) - path_m(closure.from)) > config_.closures.submap_half_length_m ||
        std::fabs(path_m(v.to) - path_m(closure.to)) > config_.closures.submap_half_length_m) {
      continue;
    }
    const auto along = [&](int a, int b) {
      return set_.keyframe(a).T_drive_base.inverse() * set_.keyframe(b).T_drive_base;
    };
    const Pose2 same = along(closure.from, v.from) * v.T_from_to * along(v.to, closure.to);
    if (distance_m(same, closure.match.T_from_to) < config_.closures.match.rival_distance_m &&
        std::fabs(normalize_angle_rad(same.yaw_rad - closure.match.T_from_to.yaw_rad)) <
            config_.closures.match.rival_angle_deg * kPi / 180.0) {
      return &v;
    }
  }
  return nullptr;
}

void ClosureFinder::keep(Closure closure) {
  closure.from_points = thinned(submap(closure.from).points());
  closure.to_points = thinned(submap(closure.to).points());
  closures_.push_back(std::move(closure));
}

bool ClosureFinder::add(Closure closure, const Pose2& prior) {
  const bool listed = std::any_of(verdicts_.begin(), verdicts_.end(), [&](const ClosureVerdict& v) {
    return v.allow && v.from == closure.from && v.to == closure.to;
  });
  if (listed) return false;  // allow() has it
  const double path_m = drift_path_m(closure.from, closure.to);
  const MatchWindow window = window_for(path_m);
  attempts_[{closure.from, closure.to}] = {prior, window.radius_m};
  closure.match =
      match_submaps(config_.closures.match, submap(closure.from), submap(closure.to), prior, window);
  closure.matched = closure.match.accepted;
  if (closure.matched && config_.closures.falsify_share > 0.0) {
    RandomStream random(config_.closures.falsify_seed, random_stream::kTest,
                        static_cast<std::uint64_t>(closure.from), static_cast<std::uint64_t>(closure.to));
    if (random.uniform() < config_.closures.falsify_share) {
      closure.source = "falsified";
      closure.match.T_from_to =
          closure.match.T_from_to *
          Pose2{random.normal(0.0, 2.0), random.normal(0.0, 2.0), random.normal(0.0, 0.5)};
    }
  }
  PoseGraphEdge edge{closure.from, closure.to, closure.match.T_from_to, closure.match.information, true};
  if (!closure.matched) {
    closure.reason = closure.match.reason;
    if (closure.source != "button" || distance_m(prior, {}) > window.radius_m) return false;
    // The button's word alone: the same place, the heading unknown beyond what the drive says.
    edge.T_from_to = {0.0, 0.0, prior.yaw_rad};
    const double w = 1.0 / (config_.closures.button_sd_m * config_.closures.button_sd_m);
    edge.information = Eigen::Vector3d(w, w, 1.0).asDiagonal();
    closure.match.T_from_to = edge.T_from_to;
    closure.match.information = edge.information;
  }
  return join(std::move(closure), edge);
}

/// Takes a closure in if the drive can bend so far: the growth of the optimum's chi2 is the closure's squared
/// distance in standard deviations, given all that is known (its innovation).
bool ClosureFinder::join(Closure closure, const PoseGraphEdge& edge) {
  if (const ClosureVerdict* verdict = denied(closure)) {
    const bool itself = verdict->from == closure.from && verdict->to == closure.to;
    closure.verdict = itself ? "deny" : "";
    closure.reason = itself ? "denied by the list" : "the same as one that the list denies";
    keep(std::move(closure));
    return false;
  }
  PoseGraph trial = graph_;
  trial.edges.push_back(edge);
  GraphOptimizerConfig plain = config_.graph;
  plain.robust_loss = "none";
  plain.initialization = "given";
  plain.warm_start = true;
  optimize(plain, &trial);
  closure.chi2 = chi2(trial) - chi2(graph_);
  closure.accepted = closure.chi2 < config_.closures.max_innovation;
  if (closure.accepted) {
    graph_ = std::move(trial);
  } else {
    closure.reason =
        fmt::format("the drive would have to bend too much (chi2 grows by {:.0f})", closure.chi2);
  }
  const bool accepted = closure.accepted;
  keep(std::move(closure));
  return accepted;
}

/// The list's closures that end in this drive; they are not questioned.
void ClosureFinder::allow(int drive) {
  bool any = false, placed = false;
  for (const ClosureVerdict& v : verdicts_) {
    if (!v.allow || set_.drive_of(v.to) != drive) continue;
    if (held(v.from) && held(v.to)) continue;
    Closure closure;
    closure.from = v.from;
    closure.to = v.to;
    closure.source = "list";
    closure.verdict = "allow";
    closure.accepted = true;
    closure.match = align_submaps(config_.closures.match, submap(v.from), submap(v.to), v.T_from_to);
    closure.matched = closure.match.accepted;
    closure.match.T_from_to = v.T_from_to;
    const double sd_m = config_.closures.allowed_sd_m, sd_rad = config_.closures.allowed_sd_deg * kPi / 180.0;
    closure.match.information = Eigen::Vector3d(sd_m, sd_m, sd_rad).cwiseAbs2().cwiseInverse().asDiagonal();
    graph_.edges.push_back({v.from, v.to, v.T_from_to, closure.match.information, false});
    any = true;
    if (set_.drive_of(v.from) != drive && !placed) {
      placed = true;
      const Pose2 T_map_to = graph_.nodes.at(v.from) * v.T_from_to;
      move_drive(drive, T_map_to * graph_.nodes.at(v.to).inverse());
    }
    keep(std::move(closure));
  }
  if (any) optimize_all();
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

void ClosureFinder::optimize_all() { summary_ = optimize(config_.graph, &graph_); }

/// Closures that the graph as a whole contradicts are taken out, the worst first.
void ClosureFinder::settle() {
  const bool any =
      std::any_of(closures_.begin(), closures_.end(), [](const Closure& c) { return c.accepted; });
  if (!any) return;
  optimize_all();
  const double limit = 4.0 * config_.graph.robust_scale * config_.graph.robust_scale;
  while (true) {
    std::size_t worst_edge = 0;
    double worst = limit;
    for (std::size_t i = 0; i < graph_.edges.size(); ++i) {
      const PoseGraphEdge& e = graph_.edges[i];
      if (!e.robust || (held(e.from) && held(e.to))) continue;
      const double chi2 = edge_chi2(e, graph_.nodes.at(e.from), graph_.nodes.at(e.to));
      if (chi2 > worst) {
        worst = chi2;
        worst_edge = i;
      }
    }
    if (worst <= limit) break;
    const PoseGraphEdge bad = graph_.edges[worst_edge];
    for (Closure& closure : closures_) {
      if (!closure.accepted || closure.verdict == "allow" || closure.from != bad.from || closure.to != bad.to)
        continue;
      closure.accepted = false;
      closure.chi2 = worst;
      closure.reason = fmt::format("contradicts the rest of the graph (chi2 {:.0f})", worst);
    }
    graph_.edges.erase(graph_.edges.begin() + static_cast<std::ptrdiff_t>(worst_edge));
    optimize_all();
  }
  for (Closure& closure : closures_) {
    if (!closure.accepted) continue;
    closure.chi2 =
        edge_chi2({closure.from, closure.to, closure.match.T_from_to, closure.match.information, true},
                  graph_.nodes.at(closure.from), graph_.nodes.at(closure.to));
  }
}

void ClosureFinder::run(const std::function<void(double)>& progress) {
  progress_ = progress;
  for (int drive = 0; drive < set_.count(); ++drive) {
    const int first = set_.first(drive);
    if (set_.first(drive + 1) <= held_ || set_.first(drive + 1) == first) continue;
    if (config_.closures.buttons) pair_buttons(drive, first);
    if (drive == 0) allow(drive);
    if (config_.closures.automatic) search(drive, first);
    if (drive == 0) continue;
    allow(drive);
    locate(drive);
    if (config_.closures.buttons) pair_buttons(drive, 0);
    if (config_.closures.automatic) search(drive, 0);
  }
  settle();
}

}  // namespace knav
