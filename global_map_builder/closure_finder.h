#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "global_map_builder/drive_recorder.h"
#include "global_map_builder/submap.h"

namespace knav {

/// Two visits of one place, and what was made of them.
struct Closure {
  int from = 0, to = 0;   ///< keyframes, from < to
  std::string source;     ///< "button" or "automatic"
  bool matched = false;   ///< by the local maps; otherwise the button's word alone
  bool accepted = false;  ///< used by the map
  std::string reason;     ///< why not
  MatchResult match;
  double chi2 = 0.0;  ///< of its edge in the final graph
};

/// Finds the closures of a drive and keeps the pose graph that they give. Works along the drive: every
/// closure found moves the graph, so that the next is sought from a better estimate.
class ClosureFinder {
 public:
  ClosureFinder(const MapBuilderConfig& config, const DriveRecorder& drive);

  /// @param progress called with a fraction in [0, 1]
  void run(const std::function<void(double)>& progress);

  const PoseGraph& graph() const { return graph_; }
  /// All that were verified or asked for by the button, and those that the optimiser then refused.
  const std::vector<Closure>& closures() const { return closures_; }
  const GraphOptimizerSummary& summary() const { return summary_; }

 private:
  const Submap& submap(int keyframe);
  void pair_buttons();
  void search_from(int keyframe);
  std::vector<int> earlier_visits(int keyframe) const;
  double drift_path_m(int from, int to) const;
  MatchWindow window_for(double path_m) const;
  bool tried(int from, int to, const Pose2& T_from_to) const;
  bool add(Closure closure, const Pose2& prior);
  bool join(Closure closure, const PoseGraphEdge& edge);
  void optimize_all();
  void settle();

  const MapBuilderConfig& config_;
  const DriveRecorder& drive_;
  PoseGraph graph_;
  std::vector<Closure> closures_;
  std::map<int, std::unique_ptr<Submap>> submaps_;
  struct Attempt {
    Pose2 prior;
    double radius_m;
  };
  std::map<std::pair<int, int>, Attempt> attempts_;
  GraphOptimizerSummary summary_;
};

/// What the frames between two path lengths saw, with poses relative to a keyframe.
std::vector<TsdfObservation> observations_near(const DriveRecorder& drive, int keyframe, double half_length_m,
                                               const ObservationLimits& limits);

}  // namespace knav
