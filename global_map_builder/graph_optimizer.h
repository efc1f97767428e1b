#pragma once

#include <string>
#include <vector>

#include "global_map_builder/pose_graph.h"

namespace knav {

struct GraphOptimizerConfig {
  std::string initialization = "best";
  std::string robust_loss = "dcs";
  double robust_scale = 3.0;
  int max_iterations = 100;
  /// Not a parameter: the poses given are the optimum but for a newest edge. Full steps of Gauss-Newton from the first on, to 1e-6 of
  /// the cost: Levenberg-Marquardt's damping is worth thousands of times what a long drive's steps hold it with.
  bool warm_start = false;

  template <class Visitor>
  void visit(Visitor& v) {
    v.choice("initialization", initialization, {"given", "chordal", "best"},
             "Start from the poses given, from rotations and then positions solved linearly (chordal "
             "relaxation), or "
             "from both, keeping the better end.");
    v.choice("robust_loss", robust_loss, {"none", "cauchy", "dcs"},
             "Loss on closures: dcs (dynamic covariance scaling) lets a wrong one fade out.");
    v.number("robust_scale", robust_scale, 0.1, 100, "sigma",
             "Errors beyond this many standard deviations fade.");
    v.integer("max_iterations", max_iterations, 1, 10000, "", "Of the optimiser.");
  }
  std::vector<std::string> validate() const { return {}; }
};

struct GraphOptimizerSummary {
  double initial_chi2 = 0.0;  ///< of the poses given
  double final_chi2 = 0.0;    ///< without robust loss
  double robust_cost = 0.0;   ///< with it, without a factor 1/2
  int iterations = 0;
  double time_s = 0.0;
  std::string initialization;  ///< that the result came from
};

/// Moves the nodes to where sum e' information e is least (Ceres, Levenberg-Marquardt on SE(2)). The lowest
/// node of every connected part stays where it is, and so do the held ones (without chordal start, then).
/// UserError if an edge names a missing node.
GraphOptimizerSummary optimize(const GraphOptimizerConfig& config, PoseGraph* graph);

/// Rotations first: the chordal relaxation of all headings (one sparse linear solve over unit complex
/// numbers), then all positions by a second linear solve given those headings (Carlone et al.,
/// "Initialization Techniques for 3D SLAM", ICRA 2015). Independent of the poses given but for the lowest
/// node of every connected part.
void initialize_chordal(PoseGraph* graph);

/// The lowest node number of every connected part.
std::vector<int> anchor_nodes(const PoseGraph& graph);

}  // namespace knav
