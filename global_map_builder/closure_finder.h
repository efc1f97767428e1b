#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "global_map_builder/closure.h"
#include "global_map_builder/drive.h"
#include "global_map_builder/graph_optimizer.h"
#include "global_map_builder/map_builder_config.h"
#include "global_map_builder/submap.h"

namespace knav {

/// The drives' keyframes under one numbering: the nodes of the graph.
class DriveSet {
 public:
  explicit DriveSet(const std::vector<Drive>& drives);

  const std::vector<Drive>& drives() const { return drives_; }
  int count() const { return static_cast<int>(drives_.size()); }
  int nodes() const { return first_.back(); }
  int first(int drive) const { return first_[static_cast<std::size_t>(drive)]; }
  int drive_of(int node) const;
  const Drive& drive(int node) const { return drives_[static_cast<std::size_t>(drive_of(node))]; }
  const Keyframe& keyframe(int node) const {
    return drive(node).keyframes[static_cast<std::size_t>(node - first(drive_of(node)))];
  }
  /// Along all drives, one after the other with `gap_m` between; never falls.
  double path_m(int node, double gap_m) const {
    return keyframe(node).path_m + gap_m * drive_of(node) +
           path_before_m_[static_cast<std::size_t>(drive_of(node))];
  }

 private:
  const std::vector<Drive>& drives_;
  std::vector<int> first_;
  std::vector<double> path_before_m_;
};

/// Finds the closures of drives and keeps the pose graph that they give. Works along each drive: every
/// closure found moves the graph, so that the next is sought from a better estimate. A second drive is closed
/// in itself, then found in what is there (see locate()), then closed with it.
class ClosureFinder {
 public:
  ClosureFinder(const MapBuilderConfig& config, const DriveSet& set);

  /// The first drives' nodes stay at these poses, joined by these closures.
  void hold(const std::vector<Pose2>& T_map_keyframe, const std::vector<Closure>& closures);
  /// The user's list; before run().
  void set_verdicts(std::vector<ClosureVerdict> verdicts) { verdicts_ = std::move(verdicts); }
  /// @param progress called with a fraction in [0, 1]
  /// UserError if a drive shares no place with those before it.
  void run(const std::function<void(double)>& progress);

  const PoseGraph& graph() const { return graph_; }
  /// All that were verified or asked for by the button, and those that the optimiser then refused.
  const std::vector<Closure>& closures() const { return closures_; }
  const GraphOptimizerSummary& summary() const { return summary_; }

 private:
  struct Attempt {
    Pose2 prior;
    double radius_m;
  };
  /// A match of a new drive's place with a known one, and where it would put the new drive's frame.
  struct Hypothesis {
    int from = 0, to = 0;
    MatchResult match;
    Pose2 T_map_drive;
  };

  /// A place for a whole drive.
  struct Location {
    Pose2 T_map_drive;
    std::vector<Hypothesis> agreeing;  ///< its places where the map agrees
    int contradicting = 0;             ///< where it shows something else
    double astray = 1.0;               ///< share of the compared walls that the other does not show
    double worth() const {
      return (static_cast<double>(agreeing.size()) - contradicting) * (1.0 - 2.0 * astray);
    }
  };

  const Submap& submap(int keyframe);
  void make_submap(int keyframe);
  void prepare_submaps(const std::vector<int>& keyframes);
  void pair_buttons(int drive, int lowest);
  void search(int drive, int lowest);
  void search_from(int keyframe, int lowest);
  void allow(int drive);
  void locate(int drive);
  Location verify(const Hypothesis& hypothesis, const std::vector<int>& places,
                  const std::vector<int>& asked) const;
  std::vector<Hypothesis> distinct(const std::vector<Hypothesis>& found) const;
  std::vector<Hypothesis> most_central_first(const std::vector<Hypothesis>& agreeing) const;
  void judge_location(int drive, std::size_t found, const std::vector<Location>& locations);
  void move_drive(int drive, const Pose2& T_map_drive);
  bool agree(const Hypothesis& h, const Hypothesis& with) const;
  std::vector<Hypothesis> agreeing(const std::vector<Hypothesis>& found, const Hypothesis& with) const;
  std::vector<int> spread(int first, int last, double spacing_m) const;
  std::vector<int> earlier_visits(int keyframe, int lowest) const;
  double path_m(int node) const { return set_.path_m(node, config_.closures.min_path_m); }
  double drift_path_m(int from, int to) const;
  MatchWindow window_for(double path_m) const;
  bool tried(int from, int to, const Pose2& T_from_to) const;
  const ClosureVerdict* denied(const Closure& closure) const;
  bool add(Closure closure, const Pose2& prior);
  bool join(Closure closure, const PoseGraphEdge& edge);
  void keep(Closure closure);
  bool held(int node) const { return node < held_; }
  void optimize_all();
  void settle();

  const MapBuilderConfig& config_;
  const DriveSet& set_;
  PoseGraph graph_;
  int held_ = 0;  ///< nodes below this stay
  std::vector<Closure> closures_;
  std::vector<ClosureVerdict> verdicts_;
  std::map<int, std::unique_ptr<Submap>> submaps_;
  std::map<std::pair<int, int>, Attempt> attempts_;
  GraphOptimizerSummary summary_;
  std::function<void(double)> progress_;
};

}  // namespace knav
