#include "global_map_builder/closure_finder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <queue>

namespace knav {
namespace {

constexpr double kSubmapFrameDistance_m = 0.1;
constexpr double kSubmapFrameAngle_rad = 0.07;
constexpr std::size_t kSubmapFrames = 400;

}  // namespace

std::vector<TsdfObservation> observations_near(const DriveRecorder& drive, int keyframe, double half_length_m,
                                               const ObservationLimits& limits) {
  const std::vector<Keyframe>& keyframes = drive.keyframes();
  const auto index = static_cast<std::size_t>(keyframe);
  // Not across a break of the mapper's epoch.
  std::size_t first = index, last = index;
  while (first > 0 && !keyframes[first].after_break &&
         keyframes[index].path_m - keyframes[first - 1].path_m <= half_length_m) {
    --first;
  }
  while (last + 1 < keyframes.size() && !keyframes[last + 1].after_break &&
         keyframes[last + 1].path_m - keyframes[index].path_m <= half_length_m) {
    ++last;
  }
  const double end_s = last + 1 < keyframes.size() ? keyframes[last + 1].stamp_s : 1e300;
  const Pose2 T_keyframe_drive = keyframes[index].T_drive_base.inverse();
  const auto& frames = drive.frames();
  const auto before = [](const DriveFrame& frame, double stamp_s) { return frame.stamp_s < stamp_s; };
  auto frame = std::lower_bound(frames.begin(), frames.end(), keyframes[first].stamp_s, before);
  std::vector<TsdfObservation> observations;
  const Pose2* taken = nullptr;
  for (; frame != frames.end() && frame->stamp_s < end_s && observations.size() < kSubmapFrames; ++frame) {
    if (taken != nullptr && distance_m(*taken, frame->T_drive_base) < kSubmapFrameDistance_m &&
        std::fabs(normalize_angle_rad(taken->yaw_rad - frame->T_drive_base.yaw_rad)) <
            kSubmapFrameAngle_rad) {
      continue;
    }
    taken = &frame->T_drive_base;
    TsdfObservation& observation = observations.emplace_back();
    std::visit([&](const auto& data) { observation_from(data, limits, &observation); }, frame->data);
    observation.T_map_sensor = T_keyframe_drive * frame->T_drive_base * frame->T_base_sensor;
  }
  return observations;
}

ClosureFinder::ClosureFinder(const MapBuilderConfig& config, const DriveRecorder& drive)
    : config_(config), drive_(drive) {
  for (std::size_t i = 0; i < drive.keyframes().size(); ++i) {
    graph_.nodes[static_cast<int>(i)] = drive.keyframes()[i].T_drive_base;
  }
  graph_.edges = drive.edges();
}

const Submap& ClosureFinder::submap(int keyframe) {
  std::unique_ptr<Submap>& entry = submaps_[keyframe];
  if (!entry) {
    SurfaceConfig surface = config_.surface;
    surface.range_max_m = std::min(surface.range_max_m, config_.closures.submap_range_max_m);
    surface.min_looks = 2;
    entry = std::make_unique<Submap>(
        surface,
        observations_near(drive_, keyframe, config_.closures.submap_half_length_m, surface.limits()));
  }
  return *entry;
}

/// The shortest way between two keyframes along the drive and over the closures accepted so far: what error
/// can have gathered between them.
double ClosureFinder::drift_path_m(int from, int to) const {
  const auto& keyframes = drive_.keyframes();
  std::vector<std::vector<int>> jumps(keyframes.size());
  for (const Closure& closure : closures_) {
    if (!closure.accepted) continue;
    jumps[static_cast<std::size_t>(closure.from)].push_back(closure.to);
    jumps[static_cast<std::size_t>(closure.to)].push_back(closure.from);
  }
  std::vector<double> best(keyframes.size(), 1e300);
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> open;
  const auto reach = [&](int node, double length) {
    double& known = best[static_cast<std::size_t>(node)];
    if (length < known) open.emplace(known = length, node);
  };
  reach(from, 0.0);
  while (!open.empty()) {
    const auto [length, node] = open.top();
    open.pop();
    const auto i = static_cast<std::size_t>(node);
    if (node == to) return length;
    if (length > best[i]) continue;
    if (i > 0) reach(node - 1, length + keyframes[i].path_m - keyframes[i - 1].path_m);
    if (i + 1 < keyframes.size()) reach(node + 1, length + keyframes[i + 1].path_m - keyframes[i].path_m);
    for (const int other : jumps[i]) reach(other, length);
  }
  return keyframes.back().path_m;
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
std::vector<int> ClosureFinder::earlier_visits(int keyframe) const {
  const auto& keyframes = drive_.keyframes();
  const Pose2& here = graph_.nodes.at(keyframe);
  const double path_m = keyframes[static_cast<std::size_t>(keyframe)].path_m;
  std::vector<int> visits;
  int nearest = -1;
  double nearest_distance = 0.0, left_at_path = 0.0;
  const auto finish = [&] {
    if (nearest >= 0) visits.push_back(nearest);
    nearest = -1;
  };
  for (int other = 0; other < keyframe; ++other) {
    const double other_path = keyframes[static_cast<std::size_t>(other)].path_m;
    if (path_m - other_path < config_.closures.min_path_m) break;
    const double distance = distance_m(here, graph_.nodes.at(other));
    const double limit = config_.closures.nearest_m + window_for(path_m - other_path).radius_m;
    if (distance > limit) continue;
    if (nearest >= 0 && other_path - left_at_path > config_.closures.nearest_m) finish();
    if (nearest < 0 || distance < nearest_distance) {
      nearest = other;
      nearest_distance = distance;
    }
    left_at_path = other_path;
    // A long pass in a small place is split, so that no visit hides behind another.
    if (other_path - keyframes[static_cast<std::size_t>(nearest)].path_m > 2.0 * config_.closures.nearest_m)
      finish();
  }
  finish();
  return visits;
}

bool ClosureFinder::tried(int from, int to, const Pose2& prior) const {
  const auto attempt = attempts_.find({from, to});
  return attempt != attempts_.end() &&
         distance_m(attempt->second.prior, prior) < 0.5 * attempt->second.radius_m;
}

bool ClosureFinder::add(Closure closure, const Pose2& prior) {
  const double path_m = drift_path_m(closure.from, closure.to);
  const MatchWindow window = window_for(path_m);
  attempts_[{closure.from, closure.to}] = {prior, window.radius_m};
  closure.match =
      match_submaps(config_.closures.match, submap(closure.from), submap(closure.to), prior, window);
  closure.matched = closure.match.accepted;
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
  PoseGraph trial = graph_;
  trial.edges.push_back(edge);
  GraphOptimizerConfig plain = config_.graph;
  plain.robust_loss = "none";
  plain.initialization = "given";
  optimize(plain, &trial);
  closure.chi2 = chi2(trial) - chi2(graph_);
  closure.accepted = closure.chi2 < config_.closures.max_innovation;
  if (closure.accepted) {
    graph_ = std::move(trial);
  } else {
    closure.reason =
        fmt::format("the drive would have to bend too much (chi2 grows by {:.0f})", closure.chi2);
  }
  closures_.push_back(std::move(closure));
  return closures_.back().accepted;
}

void ClosureFinder::pair_buttons() {
  std::vector<int> marks;
  for (std::size_t i = 0; i < drive_.keyframes().size(); ++i) {
    if (drive_.keyframes()[i].marked) marks.push_back(static_cast<int>(i));
  }
  for (std::size_t b = 1; b < marks.size(); ++b) {
    // The earlier mark nearest in the estimate, if it can be the same place at all.
    int nearest = -1;
    double nearest_distance = 0.0;
    for (std::size_t a = 0; a < b; ++a) {
      const double path_m = drive_.keyframes()[static_cast<std::size_t>(marks[b])].path_m -
                            drive_.keyframes()[static_cast<std::size_t>(marks[a])].path_m;
      const double distance = distance_m(graph_.nodes.at(marks[a]), graph_.nodes.at(marks[b]));
      if (path_m < 2.0 || distance > window_for(drift_path_m(marks[a], marks[b])).radius_m) continue;
      if (nearest < 0 || distance < nearest_distance) {
        nearest = marks[a];
        nearest_distance = distance;
      }
    }
    if (nearest < 0) continue;
    Closure closure;
    closure.from = nearest;
    closure.to = marks[b];
    closure.source = "button";
    add(closure, graph_.nodes.at(nearest).inverse() * graph_.nodes.at(marks[b]));
  }
}

void ClosureFinder::search_from(int keyframe) {
  for (const int visit : earlier_visits(keyframe)) {
    const Pose2 prior = graph_.nodes.at(visit).inverse() * graph_.nodes.at(keyframe);
    const double radius_m = window_for(drift_path_m(visit, keyframe)).radius_m;
    if (distance_m(prior, {}) > config_.closures.nearest_m + radius_m || tried(visit, keyframe, prior))
      continue;
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
      if (!e.robust) continue;
      const double chi2 = edge_chi2(e, graph_.nodes.at(e.from), graph_.nodes.at(e.to));
      if (chi2 > worst) {
        worst = chi2;
        worst_edge = i;
      }
    }
    if (worst <= limit) break;
    const PoseGraphEdge bad = graph_.edges[worst_edge];
    for (Closure& closure : closures_) {
      if (!closure.accepted || closure.from != bad.from || closure.to != bad.to) continue;
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
  if (drive_.keyframes().empty()) return;
  if (config_.closures.buttons) pair_buttons();
  if (config_.closures.automatic) {
    for (int pass = 0; pass < config_.closures.passes; ++pass) {
      const std::size_t before = closures_.size();
      double next_path_m = 0.0;
      for (std::size_t i = 0; i < drive_.keyframes().size(); ++i) {
        progress((pass + static_cast<double>(i) / static_cast<double>(drive_.keyframes().size())) /
                 config_.closures.passes);
        if (drive_.keyframes()[i].path_m < next_path_m) continue;
        next_path_m = drive_.keyframes()[i].path_m + config_.closures.submap_spacing_m;
        search_from(static_cast<int>(i));
      }
      if (pass > 0 && closures_.size() == before) break;
    }
  }
  settle();
}

}  // namespace knav
