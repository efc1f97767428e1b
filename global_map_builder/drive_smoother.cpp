#include "global_map_builder/drive_smoother.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "global_map_builder/drive_refiner.h"

namespace knav {
namespace {

constexpr std::size_t kMinSteps = 20;  // fewer say nothing about what is usual
constexpr double kStepPosition_sd_m = 0.004,
                 kStepHeading_sd_rad = 0.0015;  // the mapper's, when it does not jump

/// Of one step: how far the mapper's end lies from odometry's.
struct Deviation {
  Eigen::Vector3d apart;   ///< (x [m], y [m], yaw [rad])
  Eigen::Vector2d motion;  ///< odometry's (length [m], turn [rad])
  double units;            ///< size of the step, about 1 for half a metre or half a radian
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Eigen::Vector3d vector_of(const Pose2& pose) { return {pose.x_m, pose.y_m, pose.yaw_rad}; }

std::vector<Deviation> deviations_of(const Drive& drive) {
  std::vector<Deviation> deviations;
  for (const PoseGraphEdge& edge : drive.edges) {
    const Keyframe& from = drive.keyframes[static_cast<std::size_t>(edge.from)];
    const Keyframe& to = drive.keyframes[static_cast<std::size_t>(edge.to)];
    const Pose2 odometry = from.T_odom_base.inverse() * to.T_odom_base;
    const Eigen::Vector2d motion(std::hypot(odometry.x_m, odometry.y_m), odometry.yaw_rad);
    deviations.push_back({vector_of(odometry.inverse() * edge.T_from_to), motion,
                          0.2 + 2.0 * motion.x() + 2.0 * std::fabs(motion.y())});
  }
  return deviations;
}

/// What odometry usually does wrong: in proportion to length and turn (a wheel's diameter, the wheels'
/// distance), and the spread that remains.
struct Usual {
  Eigen::Matrix<double, 3, 2> gain;
  Eigen::Vector3d sd;  ///< per unit
  Eigen::Vector3d bias(const Deviation& d) const { return gain * d.motion; }
};

Usual usual_of(const std::vector<Deviation>& deviations) {
  Usual usual;
  const Eigen::Vector3d floor(0.004, 0.004, 0.002);
  for (int c = 0; c < 3; ++c) {
    Eigen::Vector2d gain = Eigen::Vector2d::Zero();
    double sd = 0.0;
    for (int iteration = 0; iteration < 10; ++iteration) {
      std::vector<double> sizes;
      for (const Deviation& d : deviations)
        sizes.push_back(std::fabs(d.apart(c) - gain.dot(d.motion)) / d.units);
      sd = std::max(1.4826 * median(sizes), floor(c));
      // Least squares, outliers weighed down (Cauchy), drawn a little towards no error at all.
      Eigen::Matrix2d normal = 1e-3 * Eigen::Matrix2d::Identity();
      Eigen::Vector2d right = Eigen::Vector2d::Zero();
      for (std::size_t i = 0; i < deviations.size(); ++i) {
        const Deviation& d = deviations[i];
        const double z = sizes[i] / (2.0 * sd), weight = 1.0 / (d.units * d.units * (1.0 + z * z));
        normal += weight * d.motion * d.motion.transpose();
        right += weight * d.apart(c) * d.motion;
      }
      gain = normal.inverse() * right;
    }
    usual.gain.row(c) = gain.transpose();
    usual.sd(c) = sd;
  }
  return usual;
}

Eigen::Matrix3d diagonal_information(const Eigen::Vector3d& sd) {
  return sd.cwiseProduct(sd).cwiseInverse().asDiagonal();
}

Eigen::Vector3d step_sd() { return {kStepPosition_sd_m, kStepPosition_sd_m, kStepHeading_sd_rad}; }

}  // namespace

int smooth_drive(const RefinementConfig& config, const GraphOptimizerConfig& graph_config,
                 const SurfaceConfig& surface, Drive* drive, const std::function<void(double)>& progress) {
  const std::vector<PoseGraphEdge> steps = drive->edges;
  if (!config.enabled || steps.size() < kMinSteps) return 0;
  const std::vector<Deviation> deviations = deviations_of(*drive);
  const Usual usual = usual_of(deviations);

  PoseGraph graph;
  for (std::size_t i = 0; i < drive->keyframes.size(); ++i) {
    graph.nodes[static_cast<int>(i)] = drive->keyframes[i].T_drive_base;
  }
  std::vector<bool> jump(steps.size());
  for (std::size_t i = 0; i < steps.size(); ++i) {
    // A jump is decided here rather than by a robust loss: starting from the mapper's poses that would keep
    // them.
    const Eigen::Vector3d excess = (deviations[i].apart - usual.bias(deviations[i])) / deviations[i].units;
    jump[i] = excess.cwiseQuotient(usual.sd).squaredNorm() > config.jump_chi2;
    if (!jump[i]) {
      PoseGraphEdge step = steps[i];
      step.information = diagonal_information(step_sd());
      graph.edges.push_back(step);
    }
    PoseGraphEdge odometry = steps[i];
    const Keyframe& from = drive->keyframes[i];
    const Keyframe& to = drive->keyframes[i + 1];
    const Eigen::Vector3d bias = usual.bias(deviations[i]);
    odometry.T_from_to = from.T_odom_base.inverse() * to.T_odom_base * Pose2{bias.x(), bias.y(), bias.z()};
    odometry.information = diagonal_information(config.odometry_sd_factor * deviations[i].units * usual.sd);
    graph.edges.push_back(odometry);
  }
  for (PoseGraphEdge edge : refine_drive(config, surface, *drive, progress)) {
    edge.robust = true;
    graph.edges.push_back(edge);
  }

  GraphOptimizerConfig optimizer = graph_config;
  optimizer.initialization = "given";
  optimizer.robust_loss = "cauchy";  // of the alignments, which may slip
  optimizer.robust_scale = 2.0;
  optimize(optimizer, &graph);

  int jumps = 0;
  std::vector<Pose2> poses;
  for (const auto& [id, pose] : graph.nodes) poses.push_back(pose);
  std::vector<Eigen::Matrix3d> added(steps.size(), Eigen::Matrix3d::Zero());
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (!jump[i]) continue;
    ++jumps;
    const Eigen::Vector3d sd = deviations[i].units * usual.sd;
    added[i] = sd.cwiseProduct(sd).asDiagonal();
  }
  drive->adjust(poses, added);
  return jumps;
}

}  // namespace knav
