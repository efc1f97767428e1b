#include "global_map_builder/closure_finder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

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
