#pragma once

#include <Eigen/Core>
#include <map>
#include <utility>
#include <vector>

#include "core/pose2.h"
#include "global_map_builder/map_builder_config.h"
#include "global_map_builder/pose_graph.h"
#include "global_map_builder/range_offset.h"
#include "global_map_builder/view_pairs.h"

namespace knav {

/// The normal equations of all poses (sparse) and of what a drive's frames share (few, joined to everything): the offsets of its
/// depth camera, and the scale of its odometry's distances.
struct JointEquations {
  static constexpr int kScale = RangeOffset::kKnots, kShared = kScale + 1;  ///< of a drive

  explicit JointEquations(std::size_t nodes, std::size_t drives)
      : g_poses(Eigen::VectorXd::Zero(3 * static_cast<int>(nodes))),
        mixed(Eigen::MatrixXd::Zero(3 * static_cast<int>(nodes), kShared * static_cast<int>(drives))),
        shared(Eigen::MatrixXd::Zero(mixed.cols(), mixed.cols())),
        g_shared(Eigen::VectorXd::Zero(mixed.cols())) {}

  void add_block(int a, int b, const Eigen::Matrix3d& H) {
    if (a < b) std::swap(a, b), add_lower(a, b, H.transpose());
    else add_lower(a, b, H);
  }
  void add_lower(int a, int b, const Eigen::Matrix3d& H) {
    const auto [entry, made] = blocks.try_emplace({a, b}, Eigen::Matrix3d::Zero());
    entry->second += H;
  }

  std::map<std::pair<int, int>, Eigen::Matrix3d> blocks;  ///< lower triangle
  Eigen::VectorXd g_poses;
  Eigen::MatrixXd mixed, shared;
  Eigen::VectorXd g_shared;
};

/// What odometry says of the step from keyframe `from` to the next: its length, up to a scale that the drive has.
struct OdometryStep {
  int from = 0, drive = 0;
  double length_m = 0.0, sd_m = 0.0;
};

void add_pair(const ViewPair& pair, int drive_from, int drive_to, const PairEquations& equations, double weight,
              JointEquations* all);
/// @param fade_chi2  a robust edge counts less beyond this (dynamic covariance scaling)
void add_edge(const PoseGraphEdge& edge, const std::vector<Pose2>& poses, double fade_chi2, JointEquations* all);
void add_odometry(const OdometryStep& step, const std::vector<Pose2>& poses, double scale, JointEquations* all);
/// How large a camera's offsets can be at all, and that they vary slowly; how wrong odometry's scale can be.
void add_priors(const JointRefinementConfig& config, const std::vector<RangeOffset>& offset, const std::vector<double>& scale,
                JointEquations* all);
/// The step to the minimum; false if the equations cannot be solved.
bool solve(const JointEquations& all, Eigen::VectorXd* poses, Eigen::VectorXd* shared);

}  // namespace knav
