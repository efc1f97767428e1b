#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/pose2.h"

namespace knav {

/// Weighted pose hypotheses, as structure of arrays. weight sums to 1 after normalize().
struct ParticleSet {
  std::vector<double> x_m, y_m, yaw_rad;
  std::vector<double> weight;

  std::size_t size() const { return x_m.size(); }
  void resize(std::size_t count);
  Pose2 pose(std::size_t i) const { return {x_m[i], y_m[i], yaw_rad[i]}; }
  void set(std::size_t i, const Pose2& pose) {
    x_m[i] = pose.x_m;
    y_m[i] = pose.y_m;
    yaw_rad[i] = pose.yaw_rad;
  }
};

/// Scales the weights to sum 1. Returns false, leaving them uniform, if their sum is 0 or not finite.
bool normalize_weights(ParticleSet& particles);

/// Multiplies each weight by exp(-(cost_i - min cost) / temperature) and normalises.
void weigh_by_cost(ParticleSet& particles, const std::vector<float>& cost, double temperature);

/// 1 / sum w^2.
double effective_sample_size(const ParticleSet& particles);

struct PoseEstimate {
  Pose2 mean;                                            ///< yaw by its circular mean
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< (x [m], y [m], yaw [rad])
};
PoseEstimate weighted_mean(const ParticleSet& particles);

/// Low-variance (systematic) resampling to `count` particles of equal weight. `u` in [0, 1) is the single random
/// number it needs; `parent`, if given, receives each new particle's old index.
void resample_low_variance(ParticleSet& particles, std::size_t count, double u,
                           std::vector<std::uint32_t>* parent = nullptr);

}  // namespace knav
