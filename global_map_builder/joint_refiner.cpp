#include "global_map_builder/joint_refiner.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "global_map_builder/graph_optimizer.h"
#include "global_map_builder/view_pairs.h"

namespace knav {
namespace {

constexpr std::size_t kBatch = 1024;  // pairs compared at once, to bound memory
constexpr int kKnots = RangeOffset::kKnots;
constexpr double kFade_sd = 3.0;  // a point that is off by so many standard deviations counts a quarter
/// Information of the offsets' sum. An offset of all columns alike bends drives almost as freely as it bends walls, so
/// that millimetres elsewhere (the rows of a moving camera's image) would be taken for it: it stays 0.
constexpr double kMean = 1e8;
/// How much more a closure of the user's list weighs here: what many views say does not overrule him.
constexpr double kAllowed = 100.0;
constexpr double kHold = 1e12;  // information of what must not move

/// The normal equations of all poses (sparse) and all offsets (few, joined to everything).
struct Equations {
  explicit Equations(std::size_t nodes, std::size_t drives)
      : g_poses(Eigen::VectorXd::Zero(3 * static_cast<int>(nodes))),
        mixed(Eigen::MatrixXd::Zero(3 * static_cast<int>(nodes), kKnots * static_cast<int>(drives))),
        offsets(Eigen::MatrixXd::Zero(mixed.cols(), mixed.cols())),
        g_offsets(Eigen::VectorXd::Zero(mixed.cols())) {}

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
  Eigen::MatrixXd mixed, offsets;
  Eigen::VectorXd g_offsets;
};

void add_pair(const ViewPair& pair, int drive_from, int drive_to, const PairEquations& e, double weight,
              Equations* all) {
  const int node[2] = {pair.from, pair.to}, drive[2] = {drive_from, drive_to};
  for (int i = 0; i < 2; ++i) {
    all->g_poses.segment<3>(3 * node[i]) += weight * e.g.segment<3>(3 * i);
    all->g_offsets.segment<kKnots>(kKnots * drive[i]) +=
        weight * e.g.segment<kKnots>(PairEquations::kOffset + kKnots * i);
    all->add_lower(node[i], node[i], weight * e.H.block<3, 3>(3 * i, 3 * i));
    for (int k = 0; k < 2; ++k) {
      const int at = PairEquations::kOffset + kKnots * k;
      all->mixed.block<3, kKnots>(3 * node[i], kKnots * drive[k]) += weight * e.H.block<3, kKnots>(3 * i, at);
      all->offsets.block<kKnots, kKnots>(kKnots * drive[i], kKnots * drive[k]) +=
          weight * e.H.block<kKnots, kKnots>(PairEquations::kOffset + kKnots * i, at);
    }
  }
  all->add_lower(node[1], node[0], weight * e.H.block<3, 3>(3, 0));  // from < to
}

/// @param fade_chi2  a robust edge counts less beyond this (dynamic covariance scaling)
void add_edge(const PoseGraphEdge& edge, const std::vector<Pose2>& poses, double fade_chi2, Equations* all) {
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

/// The mapper's step from one keyframe to the next is better across the way, and in heading, than along it; for finding closures
/// all are taken to be alike, since a step that is trusted too much keeps true closures out.
void stiffen_step(const JointRefinementConfig& config, PoseGraphEdge* step) {
  // In the axes of the later keyframe, as the information is.
  const double c = std::cos(step->T_from_to.yaw_rad), s = std::sin(step->T_from_to.yaw_rad);
  const Eigen::Vector2d way(c * step->T_from_to.x_m + s * step->T_from_to.y_m,
                            -s * step->T_from_to.x_m + c * step->T_from_to.y_m);
  constexpr double kStanding_m = 0.02;
  const Eigen::Vector2d across =
      way.norm() > kStanding_m ? Eigen::Vector2d(-way.y(), way.x()).normalized() : Eigen::Vector2d(0.0, 1.0);
  Eigen::Matrix3d scale = Eigen::Matrix3d::Identity();
  scale.topLeftCorner<2, 2>() += (1.0 / config.step_across_share - 1.0) * across * across.transpose();
  scale(2, 2) = 1.0 / config.step_heading_share;
  step->information = scale * step->information * scale;
}

/// How large an offset can be at all, and that it varies slowly.
void add_offset_prior(const JointRefinementConfig& config, const std::vector<RangeOffset>& offset, Equations* all) {
  const double size = 1.0 / (config.offset_sd_per_m * config.offset_sd_per_m), slope = 4.0 * size;
  for (std::size_t d = 0; d < offset.size(); ++d) {
    double sum = 0.0;
    for (double v : offset[d].knot_per_m) sum += v;
    for (int k = 0; k < kKnots; ++k) {
      const int i = kKnots * static_cast<int>(d) + k;
      all->g_offsets(i) += kMean * sum;
      for (int j = 0; j < kKnots; ++j) all->offsets(i, kKnots * static_cast<int>(d) + j) += kMean;
    }
    for (int k = 0; k < kKnots; ++k) {
      const int i = kKnots * static_cast<int>(d) + k;
      const double value = offset[d].knot_per_m[static_cast<std::size_t>(k)];
      all->offsets(i, i) += size;
      all->g_offsets(i) += size * value;
      if (k + 1 == kKnots) continue;
      const double step = offset[d].knot_per_m[static_cast<std::size_t>(k) + 1] - value;
      all->offsets(i, i) += slope, all->offsets(i + 1, i + 1) += slope;
      all->offsets(i, i + 1) -= slope, all->offsets(i + 1, i) -= slope;
      all->g_offsets(i) -= slope * step, all->g_offsets(i + 1) += slope * step;
    }
  }
}

/// The step to the minimum; false if the equations cannot be solved.
bool solve(const Equations& all, Eigen::VectorXd* poses, Eigen::VectorXd* offsets) {
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
  // The few offsets by the Schur complement.
  const Eigen::VectorXd x = factor.solve(all.g_poses);
  const Eigen::MatrixXd X = factor.solve(all.mixed);
  const Eigen::MatrixXd S = all.offsets - all.mixed.transpose() * X;
  *offsets = -S.ldlt().solve(all.g_offsets - all.mixed.transpose() * x);
  *poses = -x - X * *offsets;
  return poses->allFinite() && offsets->allFinite();
}

class Refiner {
 public:
  Refiner(const JointRefinementConfig& config, const std::vector<Drive>& drives, const PoseGraph& graph,
          double robust_scale)
      : config_(config), fade_chi2_(robust_scale * robust_scale) {
    double before_m = 0.0;
    for (std::size_t d = 0; d < drives.size(); ++d) {
      for (std::size_t k = 0; k < drives[d].keyframes.size(); ++k) {
        drive_of_.push_back(static_cast<int>(d));
        path_m_.push_back(before_m + drives[d].keyframes[k].path_m);
      }
      before_m += drives[d].keyframes.empty() ? 0.0 : drives[d].keyframes.back().path_m + config.min_path_m;
    }
    for (std::size_t d = 0; d < drives.size(); ++d) {
      for (std::size_t k = 0; k < drives[d].keyframes.size(); ++k)
        views_.emplace_back(config, drives[d], static_cast<int>(k));
    }
    offset_.resize(drives.size());
    for (const auto& [id, pose] : graph.nodes) poses_.push_back(pose);
    held_.assign(poses_.size(), false);
    for (const int node : anchor_nodes(graph)) held_[static_cast<std::size_t>(node)] = true;
    for (const int node : graph.held) held_[static_cast<std::size_t>(node)] = true;
    edges_ = graph.edges;
    for (PoseGraphEdge& edge : edges_) {
      if (edge.robust) continue;
      if (edge.to != edge.from + 1) {
        edge.information *= kAllowed;
      } else if (views_[static_cast<std::size_t>(edge.to)].depth_camera()) {
        stiffen_step(config, &edge);
      }
    }
  }

  void set_fade(double scale) { fade_sd_ = scale * kFade_sd; }
  void find_pairs() { pairs_ = find_view_pairs(config_, views_, poses_, path_m_); }

  /// Mean robust cost a point.
  double misfit(double gate_m) {
    double cost = 0.0;
    double points = 0.0;
    for_pairs(gate_m, [&](const ViewPair&, const PairEquations& e) {
      cost += e.cost;
      points += e.weight;
    });
    return points <= 0.0 ? 0.0 : cost / points;
  }

  /// One step of Gauss-Newton; false if it cannot be done. @param moved_m the largest move of a keyframe
  bool step(double gate_m, double* moved_m) {
    Equations all(poses_.size(), offset_.size());
    for_pairs(gate_m, [&](const ViewPair& pair, const PairEquations& e) {
      add_pair(pair, drive_of_[static_cast<std::size_t>(pair.from)], drive_of_[static_cast<std::size_t>(pair.to)], e,
               weight_of(pair), &all);
    });
    for (const PoseGraphEdge& edge : edges_) add_edge(edge, poses_, fade_chi2_, &all);
    add_offset_prior(config_, offset_, &all);
    for (std::size_t i = 0; i < held_.size(); ++i) {
      if (held_[i]) all.add_lower(static_cast<int>(i), static_cast<int>(i), kHold * Eigen::Matrix3d::Identity());
    }
    Eigen::VectorXd move, change;
    if (!solve(all, &move, &change)) return false;
    *moved_m = 0.0;
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      const Eigen::Vector3d d = move.segment<3>(3 * static_cast<int>(i));
      if (held_[i]) continue;
      poses_[i] = {poses_[i].x_m + d.x(), poses_[i].y_m + d.y(), normalize_angle_rad(poses_[i].yaw_rad + d.z())};
      *moved_m = std::max(*moved_m, d.head<2>().norm());
    }
    for (std::size_t d = 0; d < offset_.size(); ++d) {
      for (int k = 0; k < kKnots; ++k)
        offset_[d].knot_per_m[static_cast<std::size_t>(k)] += change(kKnots * static_cast<int>(d) + k);
    }
    tbb::parallel_for(std::size_t{0}, views_.size(), [&](std::size_t i) {
      views_[i].place(offset_[static_cast<std::size_t>(drive_of_[i])]);
    });
    return true;
  }

  const std::vector<Pose2>& poses() const { return poses_; }
  const std::vector<RangeOffset>& offset() const { return offset_; }
  std::size_t pairs() const { return pairs_.size(); }

 private:
  double weight_of(const ViewPair& pair) const {
    const bool camera = views_[static_cast<std::size_t>(pair.from)].depth_camera() ||
                        views_[static_cast<std::size_t>(pair.to)].depth_camera();
    return camera ? config_.point_weight : config_.scan_point_weight;
  }
  /// In the order of pairs, whatever the number of threads.
  template <class Take>
  void for_pairs(double gate_m, const Take& take) {
    std::vector<PairEquations> batch;
    for (std::size_t first = 0; first < pairs_.size(); first += kBatch) {
      const std::size_t last = std::min(pairs_.size(), first + kBatch);
      batch.resize(last - first);
      tbb::parallel_for(first, last, [&](std::size_t i) {
        const auto from = static_cast<std::size_t>(pairs_[i].from), to = static_cast<std::size_t>(pairs_[i].to);
        compare_views(views_[from], views_[to], poses_[from], poses_[to], gate_m, fade_sd_, &batch[i - first]);
      });
      for (std::size_t i = first; i < last; ++i) take(pairs_[i], batch[i - first]);
    }
  }

  const JointRefinementConfig& config_;
  double fade_chi2_;
  std::vector<DriveView> views_;
  std::vector<int> drive_of_;
  std::vector<double> path_m_;
  std::vector<Pose2> poses_;
  std::vector<RangeOffset> offset_;
  std::vector<bool> held_;
  std::vector<PoseGraphEdge> edges_;
  std::vector<ViewPair> pairs_;
  double fade_sd_ = kFade_sd;
};

}  // namespace

JointRefinement refine_jointly(const JointRefinementConfig& config, const std::vector<Drive>& drives,
                               const PoseGraph& graph, double robust_scale,
                               const std::function<void(double)>& progress) {
  JointRefinement out;
  for (const auto& [id, pose] : graph.nodes) out.T_map_keyframe.push_back(pose);
  out.offset.resize(drives.size());
  if (!config.enabled) return out;
  Refiner refiner(config, drives, graph, robust_scale);
  bool sound = true;
  for (int round = 0; round < config.rounds && sound; ++round) {
    // Pairs are sought anew, for what lay a wall's thickness apart before may coincide now.
    refiner.find_pairs();
    refiner.set_fade(1.0);
    if (round == 0) out.misfit_before = refiner.misfit(config.gate_m);
    // What is far off now may still belong together: outliers fade later.
    refiner.set_fade(std::pow(2.0, config.rounds - 1 - round));
    double moved_m = 1.0;
    for (int k = 0; k < config.steps && sound && moved_m > 1e-3; ++k) {
      progress((round + static_cast<double>(k) / config.steps) / config.rounds);
      sound = refiner.step(config.gate_m, &moved_m);
      ++out.iterations;
    }
  }
  out.pairs = refiner.pairs();
  if (!sound) return out;
  out.misfit_after = refiner.misfit(config.gate_m);
  out.kept = out.misfit_after <= out.misfit_before;
  if (!out.kept) return out;
  out.T_map_keyframe = refiner.poses();
  out.offset = refiner.offset();
  return out;
}

}  // namespace knav
