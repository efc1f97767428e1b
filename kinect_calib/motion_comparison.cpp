#include "kinect_calib/motion_comparison.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "kinect_calib/wall_tiles.h"

namespace knav {
namespace {

constexpr int kBlocks = 10;
constexpr double kGap_s = 0.3;  // odometry is not interpolated over longer ones
constexpr double kLargestOffset_s = 0.5;
constexpr double kRate_s = 0.02;     // half of what the speed of turning is taken over
constexpr double kYawSd_rad = 0.01;  // alignments that tell less are left out
constexpr double kLeastTurn_rad = 0.15 * kPi / 180.0;
constexpr double kLeastWay_m = 0.02;
constexpr double kTurnStep_s = 0.1;
constexpr int kFewest = 40;
// Odometry's random errors after 1 rad and 1 m, growing with the root: only the weights depend on them.
constexpr double kTurnWalk_rad = 0.02, kDistanceWalk_m = 0.01, kHeadingWalk_rad = 0.012;

double huber(double size, double scale) { return size <= 1.5 * scale ? 1.0 : 1.5 * scale / size; }

double scale_of(std::vector<double> sizes) { return std::max(1.4826 * median_of(&sizes), 1e-9); }

/// Block b of kBlocks holds the motions i with block_of(i) == b.
std::size_t block_of(std::size_t i, std::size_t count) { return i * kBlocks / count; }

double jackknife_sd(const std::vector<double>& left_out) {
  double mean = 0.0, sum = 0.0;
  const auto n = static_cast<double>(left_out.size());
  for (const double value : left_out) mean += value / n;
  for (const double value : left_out) sum += (value - mean) * (value - mean);
  return std::sqrt((n - 1.0) / n * sum);
}

// ------------------------------------------------------------------------------------------------ turning

/// Of the camera, from one scan to another soon after.
struct Turn {
  double from_s, to_s, camera_rad, weight;
};

class TurnFit {
 public:
  TurnFit(std::vector<Turn> turns, const Trajectory& odometry)
      : turns_(std::move(turns)), odometry_(odometry) {}

  /// Over all offsets, to start from.
  double coarse_offset_s() const {
    double best = 0.0, best_cost = std::numeric_limits<double>::infinity();
    for (double offset = -kLargestOffset_s; offset <= kLargestOffset_s + 1e-9; offset += 0.02) {
      double oo = 1e-12, oc = 0.0;
      std::vector<std::pair<double, double>> pairs;
      for (const Turn& turn : turns_) {
        double odom = 0.0, slope = 0.0;
        if (!odometry_turn(turn, offset, &odom, &slope)) continue;
        pairs.emplace_back(odom, turn.camera_rad);
        oo += odom * odom, oc += odom * turn.camera_rad;
      }
      if (2 * pairs.size() < turns_.size()) continue;
      double cost = 0.0;
      for (const auto& [odom, camera] : pairs) cost += std::abs(camera - oc / oo * odom);
      cost /= static_cast<double>(pairs.size());
      if (cost < best_cost) best_cost = cost, best = offset;
    }
    return best;
  }

  /// (offset [s], scale) from a start; motions of block `without` left out (-1: none).
  bool fit(int without, Eigen::Vector2d* x) const {
    for (int iteration = 0; iteration < 12; ++iteration) {
      std::vector<double> residuals, sizes;
      std::vector<Eigen::Vector2d> jacobians;
      std::vector<double> weights;
      for (std::size_t i = 0; i < turns_.size(); ++i) {
        if (static_cast<int>(block_of(i, turns_.size())) == without) continue;
        double odom = 0.0, slope = 0.0;
        if (!odometry_turn(turns_[i], (*x)[0], &odom, &slope)) continue;
        residuals.push_back(turns_[i].camera_rad - (*x)[1] * odom);
        jacobians.emplace_back((*x)[1] * slope, odom);
        weights.push_back(turns_[i].weight);
        sizes.push_back(std::sqrt(turns_[i].weight) * std::abs(residuals.back()));
      }
      if (residuals.size() < static_cast<std::size_t>(kFewest) / 2) return false;
      const double scale = scale_of(sizes);
      Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
      Eigen::Vector2d b = Eigen::Vector2d::Zero();
      for (std::size_t i = 0; i < residuals.size(); ++i) {
        const double w = weights[i] * huber(sizes[i], scale);
        A += w * jacobians[i] * jacobians[i].transpose();
        b += w * jacobians[i] * residuals[i];
      }
      if (!(A.determinant() > 0.0)) return false;
      const Eigen::Vector2d step = A.inverse() * b;
      if (!step.allFinite()) return false;
      *x += Eigen::Vector2d(std::clamp(step[0], -0.05, 0.05), step[1]);
      if (std::abs((*x)[0]) > kLargestOffset_s + 0.1) return false;
      if (step.cwiseAbs().maxCoeff() < 1e-7) break;
    }
    return true;
  }

 private:
  /// What odometry turned, and how that changes with the offset.
  bool odometry_turn(const Turn& turn, double offset_s, double* turn_rad, double* per_s) const {
    Pose2 at[4];
    const double stamps[4] = {turn.from_s + offset_s - kRate_s, turn.from_s + offset_s + kRate_s,
                              turn.to_s + offset_s - kRate_s, turn.to_s + offset_s + kRate_s};
    for (int k = 0; k < 4; ++k) {
      if (!interpolate_at(odometry_, stamps[k], kGap_s, &at[k])) return false;
    }
    Pose2 from, to;
    if (!interpolate_at(odometry_, turn.from_s + offset_s, kGap_s, &from) ||
        !interpolate_at(odometry_, turn.to_s + offset_s, kGap_s, &to))
      return false;
    *turn_rad = normalize_angle_rad(to.yaw_rad - from.yaw_rad);
    *per_s = (normalize_angle_rad(at[3].yaw_rad - at[2].yaw_rad) -
              normalize_angle_rad(at[1].yaw_rad - at[0].yaw_rad)) /
             (2.0 * kRate_s);
    return true;
  }

  std::vector<Turn> turns_;
  const Trajectory& odometry_;
};

void compare_turns(const std::vector<ScanMotion>& motions, const Trajectory& odometry,
                   MotionComparison* out) {
  std::vector<Turn> turns;
  for (std::size_t i = 0; i < motions.size(); ++i) {
    const ScanMotion& motion = motions[i];
    const double yaw_information = motion.information(2, 2);
    if (!(yaw_information > 1.0 / (kYawSd_rad * kYawSd_rad))) continue;
    Turn turn = {motion.from_s, motion.to_s, motion.T_from_to.yaw_rad, 0.0};
    // Odometry's random error grows along the turn, so short steps; the alignments' own does not, so not too
    // short.
    std::size_t k = i;
    while (k > 0 && motions[k - 1].from_s == motion.from_s && motion.to_s - motions[k].to_s < kTurnStep_s)
      --k;
    if (k < i) {
      turn.from_s = motions[k].to_s;
      turn.camera_rad = normalize_angle_rad(turn.camera_rad - motions[k].T_from_to.yaw_rad);
    }
    // Standing still tells nothing, but would make the typical residual look small. By the camera: were it by
    // odometry, odometry's own errors would choose.
    const double turned_rad = std::abs(turn.camera_rad);
    if (turned_rad < kLeastTurn_rad) continue;
    turn.weight = 1.0 / (2.0 / yaw_information + kTurnWalk_rad * kTurnWalk_rad * turned_rad);
    turns.push_back(turn);
  }
  if (turns.size() < static_cast<std::size_t>(kFewest)) return;
  const TurnFit fit(std::move(turns), odometry);
  Eigen::Vector2d x(fit.coarse_offset_s(), 1.0);
  if (!fit.fit(-1, &x)) return;
  std::vector<double> offsets, scales;
  for (int block = 0; block < kBlocks; ++block) {
    Eigen::Vector2d without = x;
    if (!fit.fit(block, &without)) return;
    offsets.push_back(without[0]);
    scales.push_back(without[1]);
  }
  out->turn_known = true;
  out->time_offset_s = {x[0], jackknife_sd(offsets)};
  out->turn_scale = {x[1], jackknife_sd(scales)};
}

// ------------------------------------------------------------------------------------------------ the mount

/// t_camera = M m with m = (scale cos yaw, scale sin yaw, R(-yaw) t_mount), whitened.
struct MountRow {
  Eigen::Matrix<double, 2, 4> M;
  Eigen::Vector2d t;
};

bool fit_mount(const std::vector<MountRow>& rows, int without, Eigen::Vector4d* m) {
  std::vector<double> weights(rows.size(), 1.0);
  for (int iteration = 0; iteration < 10; ++iteration) {
    Eigen::Matrix4d A = Eigen::Matrix4d::Zero();
    Eigen::Vector4d b = Eigen::Vector4d::Zero();
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (static_cast<int>(block_of(i, rows.size())) == without) continue;
      A += weights[i] * rows[i].M.transpose() * rows[i].M;
      b += weights[i] * rows[i].M.transpose() * rows[i].t;
    }
    const Eigen::FullPivLU<Eigen::Matrix4d> solver(A);
    if (!solver.isInvertible()) return false;
    *m = solver.solve(b);
    std::vector<double> sizes;
    for (const MountRow& row : rows) sizes.push_back((row.t - row.M * *m).norm());
    const double scale = scale_of(sizes);
    for (std::size_t i = 0; i < rows.size(); ++i) weights[i] = huber(sizes[i], scale);
  }
  return m->allFinite();
}

struct Mount {
  double yaw_rad, distance_scale, forward_m, left_m;
};

Mount mount_of(const Eigen::Vector4d& m) {
  const double yaw = std::atan2(m[1], m[0]), c = std::cos(yaw), s = std::sin(yaw);
  return {yaw, std::hypot(m[0], m[1]), c * m[2] - s * m[3], s * m[2] + c * m[3]};
}

void compare_drives(const std::vector<ScanMotion>& motions, const Trajectory& odometry,
                    MotionComparison* out) {
  std::vector<MountRow> rows;
  for (const ScanMotion& motion : motions) {
    Pose2 from, to;
    const double offset_s = out->time_offset_s.value;
    if (!interpolate_at(odometry, motion.from_s + offset_s, kGap_s, &from) ||
        !interpolate_at(odometry, motion.to_s + offset_s, kGap_s, &to))
      continue;
    const Pose2 odom = from.inverse() * to;
    const Pose2& camera = motion.T_from_to;
    if (std::hypot(odom.x_m, odom.y_m) < kLeastWay_m && std::abs(camera.yaw_rad) < 2.0 * kPi / 180.0)
      continue;
    // Of the translation alone, the rotation being unknown too.
    const Eigen::Matrix3d& full = motion.information;
    if (!(full(2, 2) > 0.0)) continue;
    const Eigen::Matrix2d information =
        full.topLeftCorner<2, 2>() - full.topRightCorner<2, 1>() * full.bottomLeftCorner<1, 2>() / full(2, 2);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(information);
    const double way_m = std::hypot(odom.x_m, odom.y_m);
    const double odometry_variance = kDistanceWalk_m * kDistanceWalk_m * way_m +
                                     kHeadingWalk_rad * kHeadingWalk_rad * way_m * way_m * way_m / 3.0;
    const Eigen::Vector2d variance =
        eigen.eigenvalues().cwiseMax(1e-3).cwiseInverse() + Eigen::Vector2d::Constant(odometry_variance);
    const Eigen::Matrix2d whiten =
        variance.cwiseSqrt().cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose();
    const double c = std::cos(camera.yaw_rad), s = std::sin(camera.yaw_rad);
    MountRow row;
    row.M << odom.x_m, odom.y_m, c - 1.0, -s, odom.y_m, -odom.x_m, s, c - 1.0;
    row.M = whiten * row.M;
    row.t = whiten * Eigen::Vector2d(camera.x_m, camera.y_m);
    rows.push_back(row);
  }
  if (rows.size() < static_cast<std::size_t>(kFewest)) return;
  Eigen::Vector4d m;
  if (!fit_mount(rows, -1, &m)) return;
  const Mount mount = mount_of(m);
  std::vector<double> yaw, scale, forward, left;
  for (int block = 0; block < kBlocks; ++block) {
    Eigen::Vector4d without;
    if (!fit_mount(rows, block, &without)) return;
    const Mount other = mount_of(without);
    yaw.push_back(mount.yaw_rad + normalize_angle_rad(other.yaw_rad - mount.yaw_rad));
    scale.push_back(other.distance_scale);
    forward.push_back(other.forward_m);
    left.push_back(other.left_m);
  }
  out->drive_known = true;
  out->yaw_rad = {mount.yaw_rad, jackknife_sd(yaw)};
  out->distance_scale = {mount.distance_scale, jackknife_sd(scale)};
  out->forward_m = {mount.forward_m, jackknife_sd(forward)};
  out->left_m = {mount.left_m, jackknife_sd(left)};
}

}  // namespace

MotionComparison compare_motions(const std::vector<ScanMotion>& motions, const Trajectory& odometry) {
  MotionComparison out;
  for (std::size_t i = 1; i < odometry.size(); ++i) {
    const Pose2 step = odometry[i - 1].T_map_robot.inverse() * odometry[i].T_map_robot;
    out.turned_rad += std::abs(step.yaw_rad);
    out.turned_left_rad += std::max(0.0, step.yaw_rad);
    out.driven_m += std::hypot(step.x_m, step.y_m);
  }
  for (const ScanMotion& motion : motions) {
    Pose2 pose;
    if (interpolate_at(odometry, motion.from_s, kGap_s, &pose) &&
        interpolate_at(odometry, motion.to_s, kGap_s, &pose))
      ++out.motions;
  }
  compare_turns(motions, odometry, &out);
  compare_drives(motions, odometry, &out);
  return out;
}

}  // namespace knav
