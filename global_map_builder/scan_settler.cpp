#include "global_map_builder/scan_settler.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <variant>
#include <vector>

#include "global_map_builder/drive_view.h"
#include "global_map_builder/view_pairs.h"

namespace knav {
namespace {

constexpr std::size_t kPartners = 12;
constexpr double kFade_sd = 3.0;   // a point that is off by so many standard deviations counts a quarter
constexpr int kSteps = 6;          // of Gauss-Newton
constexpr double kMinPoints = 8;   // that must fit better a partner, beside the share
constexpr double kStay = 1e2;      // information that keeps what no view tells where it is

class Settler {
 public:
  Settler(const SettlingConfig& config, const JointRefinementConfig& views, const Drive& drive)
      : config_(config), gate_m_(views.gate_m), drive_(drive) {
    for (std::size_t k = 0; k < drive.keyframes.size(); ++k) {
      views_.emplace_back(views, drive, static_cast<int>(k));
      poses_.push_back(drive.keyframes[k].T_drive_base);
    }
    moved_.assign(poses_.size(), 0);
  }

  /// All keyframes, each against the others where they were before. @return whether any moved
  bool pass() {
    std::vector<Pose2> settled = poses_;
    std::vector<char> moved(poses_.size(), 0);
    tbb::parallel_for(std::size_t{0}, poses_.size(), [&](std::size_t k) { moved[k] = settle(k, &settled[k]) ? 1 : 0; });
    poses_.swap(settled);
    for (std::size_t k = 0; k < moved.size(); ++k) moved_[k] = moved_[k] != 0 || moved[k] != 0 ? 1 : 0;
    return std::count(moved.begin(), moved.end(), 1) > 0;
  }
  /// Of the keyframes, each counted once.
  int moved() const { return static_cast<int>(std::count(moved_.begin(), moved_.end(), 1)); }
  const std::vector<Pose2>& poses() const { return poses_; }

 private:
  struct Fit {
    double agreeing = 0.0;  ///< points that fit, over all partners
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
  };

  /// Keyframes up to span_m before and after, not across a break of the mapper's epoch.
  std::vector<std::size_t> partners_of(std::size_t k) const {
    const std::vector<Keyframe>& keyframes = drive_.keyframes;
    std::vector<std::size_t> near;
    const auto within = [&](std::size_t other) {
      return std::fabs(keyframes[other].path_m - keyframes[k].path_m) <= config_.span_m;
    };
    for (std::size_t i = k; i > 0 && !keyframes[i].after_break && within(i - 1); --i) near.push_back(i - 1);
    for (std::size_t i = k + 1; i < keyframes.size() && !keyframes[i].after_break && within(i); ++i) near.push_back(i);
    std::sort(near.begin(), near.end());
    std::vector<std::size_t> partners;
    const std::size_t take = std::min(kPartners, near.size());
    for (std::size_t i = 0; i < take; ++i) partners.push_back(near[i * near.size() / take]);
    return partners;
  }

  Fit fit(std::size_t k, const std::vector<std::size_t>& partners, const Pose2& pose) const {
    Fit sum;
    PairEquations equations;
    for (const std::size_t p : partners) {
      compare_views(views_[p], views_[k], poses_[p], pose, gate_m_, kFade_sd, &equations);
      sum.agreeing += equations.weight - equations.cost;
      sum.H += equations.H.block<3, 3>(3, 3);
      sum.g += equations.g.segment<3>(3);
    }
    return sum;
  }

  bool settle(std::size_t k, Pose2* settled) const {
    if (views_[k].empty()) return false;
    const std::vector<std::size_t> partners = partners_of(k);
    if (partners.size() < kPartners / 2) return false;
    const double now = fit(k, partners, poses_[k]).agreeing;
    double best = now;
    Pose2 best_pose = poses_[k];
    const auto most = static_cast<int>(config_.max_turn_deg / config_.turn_step_deg);
    for (int i = -most; i <= most; ++i) {
      Pose2 pose = poses_[k];
      pose.yaw_rad = normalize_angle_rad(pose.yaw_rad + i * config_.turn_step_deg * kPi / 180.0);
      const double agreeing = fit(k, partners, pose).agreeing;
      if (agreeing <= best) continue;
      best = agreeing;
      best_pose = pose;
    }
    for (int step = 0; step < kSteps; ++step) {
      const Fit here = fit(k, partners, best_pose);
      const Eigen::Vector3d move = (here.H + kStay * Eigen::Matrix3d::Identity()).ldlt().solve(-here.g);
      const Pose2 next{best_pose.x_m + move.x(), best_pose.y_m + move.y(), normalize_angle_rad(best_pose.yaw_rad + move.z())};
      const double agreeing = fit(k, partners, next).agreeing;
      if (agreeing <= best) break;
      best = agreeing;
      best_pose = next;
    }
    if (distance_m(best_pose, poses_[k]) > config_.max_move_m) return false;
    if (best < config_.min_gain * now + kMinPoints * static_cast<double>(partners.size())) return false;
    *settled = best_pose;
    return true;
  }

  const SettlingConfig& config_;
  double gate_m_;
  const Drive& drive_;
  std::vector<DriveView> views_;
  std::vector<Pose2> poses_;
  std::vector<char> moved_;  ///< in any pass
};

}  // namespace

int settle_scans(const SettlingConfig& config, const JointRefinementConfig& views, Drive* drive,
                 const std::function<void(double)>& progress) {
  if (!config.enabled || drive->keyframes.size() < 2 || !std::holds_alternative<RangeScan>(drive->frames.front().data)) return 0;
  Settler settler(config, views, *drive);
  for (int pass = 0; pass < config.passes; ++pass) {
    progress(static_cast<double>(pass) / config.passes);
    if (!settler.pass()) break;
  }
  const int settled = settler.moved();
  if (settled > 0) drive->adjust(settler.poses(), std::vector<Eigen::Matrix3d>(drive->edges.size(), Eigen::Matrix3d::Zero()));
  return settled;
}

}  // namespace knav
