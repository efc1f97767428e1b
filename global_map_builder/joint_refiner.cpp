#include "global_map_builder/joint_refiner.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "global_map_builder/graph_optimizer.h"
#include "global_map_builder/joint_equations.h"
#include "global_map_builder/view_pairs.h"

namespace knav {
namespace {

constexpr std::size_t kBatch = 1024;  // pairs compared at once, to bound memory
constexpr double kFade_sd = 3.0;  // a point that is off by so many standard deviations counts a quarter
/// How much more a closure of the user's list weighs here: what many views say does not overrule him.
constexpr double kAllowed = 100.0;
constexpr double kStanding_m = 0.02;  // a step shorter than this has no direction
constexpr double kHold = 1e12;  // information of what must not move

/// The mapper's step from one keyframe to the next is better across the way, and in heading, than along it; for finding closures
/// all are taken to be alike, since a step that is trusted too much keeps true closures out.
void stiffen_step(const JointRefinementConfig& config, PoseGraphEdge* step) {
  // In the axes of the later keyframe, as the information is.
  const double c = std::cos(step->T_from_to.yaw_rad), s = std::sin(step->T_from_to.yaw_rad);
  const Eigen::Vector2d way(c * step->T_from_to.x_m + s * step->T_from_to.y_m,
                            -s * step->T_from_to.x_m + c * step->T_from_to.y_m);
  const Eigen::Vector2d across =
      way.norm() > kStanding_m ? Eigen::Vector2d(-way.y(), way.x()).normalized() : Eigen::Vector2d(0.0, 1.0);
  Eigen::Matrix3d scale = Eigen::Matrix3d::Identity();
  scale.topLeftCorner<2, 2>() += (1.0 / config.step_across_share - 1.0) * across * across.transpose();
  scale(2, 2) = 1.0 / config.step_heading_share;
  step->information = scale * step->information * scale;
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
        after_break_.push_back(drives[d].keyframes[k].after_break);
      }
      before_m += drives[d].keyframes.empty() ? 0.0 : drives[d].keyframes.back().path_m + config.min_path_m;
    }
    for (std::size_t d = 0; d < drives.size(); ++d) {
      for (std::size_t k = 0; k < drives[d].keyframes.size(); ++k)
        views_.emplace_back(config, drives[d], static_cast<int>(k));
    }
    offset_.resize(drives.size());
    scale_.assign(drives.size(), 1.0);
    find_odometry(drives);
    for (const auto& [id, pose] : graph.nodes) poses_.push_back(pose);
    held_.assign(poses_.size(), false);
    for (const int node : anchor_nodes(graph)) held_[static_cast<std::size_t>(node)] = true;
    for (const int node : graph.held) held_[static_cast<std::size_t>(node)] = true;
    edges_ = graph.edges;
    for (PoseGraphEdge& edge : edges_) {
      if (edge.robust) continue;
      if (edge.to != edge.from + 1) {
        edge.information *= kAllowed;
      } else if (const auto to = static_cast<std::size_t>(edge.to); views_[to].depth_camera() && !after_break_[to]) {
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
    JointEquations all(poses_.size(), offset_.size());
    for_pairs(gate_m, [&](const ViewPair& pair, const PairEquations& e) {
      add_pair(pair, drive_of_[static_cast<std::size_t>(pair.from)], drive_of_[static_cast<std::size_t>(pair.to)], e,
               weight_of(pair), &all);
    });
    for (const PoseGraphEdge& edge : edges_) add_edge(edge, poses_, fade_chi2_, &all);
    for (const OdometryStep& step : odometry_) {
      add_odometry(step, poses_, scale_[static_cast<std::size_t>(step.drive)], &all);
    }
    add_priors(config_, offset_, scale_, &all);
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
      const int at = JointEquations::kShared * static_cast<int>(d);
      for (int k = 0; k < RangeOffset::kKnots; ++k) offset_[d].knot_per_m[static_cast<std::size_t>(k)] += change(at + k);
      scale_[d] += change(at + JointEquations::kScale);
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
  void find_odometry(const std::vector<Drive>& drives) {
    int node = 0;
    for (std::size_t d = 0; d < drives.size(); ++d) {
      const std::vector<Keyframe>& keyframes = drives[d].keyframes;
      for (std::size_t k = 0; k < keyframes.size(); ++k, ++node) {
        if (config_.odometry_sd_per_m <= 0.0 || k + 1 == keyframes.size() || keyframes[k + 1].after_break) continue;
        const double length_m = distance_m(keyframes[k].T_odom_base, keyframes[k + 1].T_odom_base);
        if (length_m < kStanding_m) continue;
        odometry_.push_back({node, static_cast<int>(d), length_m, config_.odometry_sd_per_m * std::sqrt(length_m)});
      }
    }
  }

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
  std::vector<bool> after_break_;  ///< the step to the keyframe is not the mapper's
  std::vector<Pose2> poses_;
  std::vector<RangeOffset> offset_;
  std::vector<OdometryStep> odometry_;
  std::vector<double> scale_;  ///< of odometry's distances, one a drive
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
    if (round == 0 && refiner.pairs() == 0) return out;  // odometry alone tells nothing that the mapper does not know
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
