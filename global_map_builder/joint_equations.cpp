#include "global_map_builder/joint_equations.h"

#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <cmath>

#include "global_map_builder/graph_optimizer.h"

namespace knav {
namespace {

constexpr int kKnots = RangeOffset::kKnots, kShared = JointEquations::kShared;
constexpr double kScale_sd = 0.05;
constexpr double kSlip_sd = 3.0;  // a step that is off by so many standard deviations counts a quarter: the wheels slipped

}  // namespace

void add_pair(const ViewPair& pair, int drive_from, int drive_to, const PairEquations& e, double weight,
              JointEquations* all) {
  const int node[2] = {pair.from, pair.to}, drive[2] = {drive_from, drive_to};
  for (int i = 0; i < 2; ++i) {
    all->g_poses.segment<3>(3 * node[i]) += weight * e.g.segment<3>(3 * i);
    all->g_shared.segment<kKnots>(kShared * drive[i]) +=
        weight * e.g.segment<kKnots>(PairEquations::kOffset + kKnots * i);
    all->add_lower(node[i], node[i], weight * e.H.block<3, 3>(3 * i, 3 * i));
    for (int k = 0; k < 2; ++k) {
      const int at = PairEquations::kOffset + kKnots * k;
      all->mixed.block<3, kKnots>(3 * node[i], kShared * drive[k]) += weight * e.H.block<3, kKnots>(3 * i, at);
      all->shared.block<kKnots, kKnots>(kShared * drive[i], kShared * drive[k]) +=
          weight * e.H.block<kKnots, kKnots>(PairEquations::kOffset + kKnots * i, at);
    }
  }
  all->add_lower(node[1], node[0], weight * e.H.block<3, 3>(3, 0));  // from < to
}

void add_edge(const PoseGraphEdge& edge, const std::vector<Pose2>& poses, double fade_chi2, JointEquations* all) {
  const Pose2 &a = poses[static_cast<std::size_t>(edge.from)], &b = poses[static_cast<std::size_t>(edge.to)];
  const Eigen::Vector3d e = edge_error(edge, a, b);
  const double chi2 = e.dot(edge.information * e);
  double scale = 1.0;
  if (edge.robust && chi2 > fade_chi2) scale = 4.0 * fade_chi2 * fade_chi2 / ((chi2 + fade_chi2) * (chi2 + fade_chi2));
  const double heading = a.yaw_rad + edge.T_from_to.yaw_rad, c = std::cos(heading), s = std::sin(heading);
  const double dx = b.x_m - a.x_m, dy = b.y_m - a.y_m;
  Eigen::Matrix3d A, B;
  A << -c, -s, -s * dx + c * dy, s, -c, -c * dx - s * dy, 0.0, 0.0, -1.0;
  B << c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0;
  const Eigen::Matrix3d W = scale * edge.information;
  all->g_poses.segment<3>(3 * edge.from) += A.transpose() * W * e;
  all->g_poses.segment<3>(3 * edge.to) += B.transpose() * W * e;
  all->add_lower(edge.from, edge.from, A.transpose() * W * A);
  all->add_lower(edge.to, edge.to, B.transpose() * W * B);
  all->add_block(edge.to, edge.from, B.transpose() * W * A);
}

void add_odometry(const OdometryStep& step, const std::vector<Pose2>& poses, double scale, JointEquations* all) {
  const Pose2 &a = poses[static_cast<std::size_t>(step.from)], &b = poses[static_cast<std::size_t>(step.from) + 1];
  const Eigen::Vector2d way(b.x_m - a.x_m, b.y_m - a.y_m);
  const double length_m = way.norm();
  if (length_m < 1e-3) return;
  const double off_m = length_m - scale * step.length_m;
  const double z2 = off_m * off_m / (kSlip_sd * kSlip_sd * step.sd_m * step.sd_m);
  const double w = 1.0 / (step.sd_m * step.sd_m * (1.0 + z2) * (1.0 + z2));
  const Eigen::Vector2d u = way / length_m;
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  H.topLeftCorner<2, 2>() = w * u * u.transpose();
  const int from = 3 * step.from, to = from + 3, at = kShared * step.drive + JointEquations::kScale;
  all->add_lower(step.from, step.from, H);
  all->add_lower(step.from + 1, step.from + 1, H);
  all->add_lower(step.from + 1, step.from, -H);
  all->g_poses.segment<2>(from) -= w * off_m * u;
  all->g_poses.segment<2>(to) += w * off_m * u;
  all->mixed.block<2, 1>(from, at) += w * step.length_m * u;
  all->mixed.block<2, 1>(to, at) -= w * step.length_m * u;
  all->shared(at, at) += w * step.length_m * step.length_m;
  all->g_shared(at) -= w * off_m * step.length_m;
}

void add_priors(const JointRefinementConfig& config, const std::vector<RangeOffset>& offset, const std::vector<double>& scale,
                JointEquations* all) {
  for (std::size_t d = 0; d < scale.size(); ++d) {
    const int at = kShared * static_cast<int>(d) + JointEquations::kScale;
    all->shared(at, at) += 1.0 / (kScale_sd * kScale_sd);
    all->g_shared(at) += (scale[d] - 1.0) / (kScale_sd * kScale_sd);
  }
  // Of the sum.
  const double common = 1.0 / (kKnots * kKnots * config.common_offset_sd_per_m * config.common_offset_sd_per_m);
  const double size = 1.0 / (config.offset_sd_per_m * config.offset_sd_per_m), slope = 4.0 * size;
  for (std::size_t d = 0; d < offset.size(); ++d) {
    double sum = 0.0;
    for (double v : offset[d].knot_per_m) sum += v;
    for (int k = 0; k < kKnots; ++k) {
      const int i = kShared * static_cast<int>(d) + k;
      all->g_shared(i) += common * sum;
      for (int j = 0; j < kKnots; ++j) all->shared(i, kShared * static_cast<int>(d) + j) += common;
    }
    for (int k = 0; k < kKnots; ++k) {
      const int i = kShared * static_cast<int>(d) + k;
      const double value = offset[d].knot_per_m[static_cast<std::size_t>(k)];
      all->shared(i, i) += size;
      all->g_shared(i) += size * value;
      if (k + 1 == kKnots) continue;
      const double step = offset[d].knot_per_m[static_cast<std::size_t>(k) + 1] - value;
      all->shared(i, i) += slope, all->shared(i + 1, i + 1) += slope;
      all->shared(i, i + 1) -= slope, all->shared(i + 1, i) -= slope;
      all->g_shared(i) -= slope * step, all->g_shared(i + 1) += slope * step;
    }
  }
}

bool solve(const JointEquations& all, Eigen::VectorXd* poses, Eigen::VectorXd* shared) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(9 * all.blocks.size());
  for (const auto& [at, H] : all.blocks) {
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        const int row = 3 * at.first + r, column = 3 * at.second + c;
        if (row >= column) entries.emplace_back(row, column, H(r, c));
      }
    }
  }
  Eigen::SparseMatrix<double> H(all.g_poses.size(), all.g_poses.size());
  H.setFromTriplets(entries.begin(), entries.end());
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(H);
  if (factor.info() != Eigen::Success) return false;
  // What is shared by the Schur complement.
  const Eigen::VectorXd x = factor.solve(all.g_poses);
  const Eigen::MatrixXd X = factor.solve(all.mixed);
  const Eigen::MatrixXd S = all.shared - all.mixed.transpose() * X;
  *shared = -S.ldlt().solve(all.g_shared - all.mixed.transpose() * x);
  *poses = -x - X * *shared;
  return poses->allFinite() && shared->allFinite();
}

}  // namespace knav
