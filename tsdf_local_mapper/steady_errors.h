#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "core/motion_model.h"
#include "core/particle_filter.h"
#include "core/pose2.h"

namespace knav {

/// What may be steadily wrong with odometry: wheels of another size, another distance between them, a skewed mount.
struct SteadyErrorsConfig {
  double memory_m = 2000.0;
  double distance_scale_sd = 0.03;
  double turn_per_m_sd = 0.02;
  double turn_scale_sd = 0.05;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("memory_m", memory_m, 0, 1000000, "m",
             "Distance over which the errors may change; 0 = none is assumed.");
    v.number("distance_scale_sd", distance_scale_sd, 0, 0.5, "", "Distances are wrong by this share (sd).");
    v.number("turn_per_m_sd", turn_per_m_sd, 0, 1, "rad/m", "Driving straight on it turns this much (sd).");
    v.number("turn_scale_sd", turn_scale_sd, 0, 0.5, "", "Turns are wrong by this share (sd).");
  }
};

/// The steady errors of odometry, estimated along with the pose (a Rao-Blackwellised particle filter): each particle
/// carries the errors' mean given its own path, all share their covariance, which depends on odometry alone. Hypotheses
/// with the right errors stay where the view tells the motion, and carry what they know on to where it tells nothing: along
/// a corridor whose end is too far to be measured well. The errors wander slowly (Ornstein-Uhlenbeck), so that their spread
/// returns to the prior's.
class SteadyErrors {
 public:
  explicit SteadyErrors(const SteadyErrorsConfig& config);

  bool on() const { return config_.memory_m > 0.0; }
  /// As if nothing were known of them.
  void forget(std::size_t particles);
  /// Moves each particle by odometry's step, by the noise, and by a sample of what is steadily wrong; each then knows more
  /// of the errors. Particle i draws from index i of the stream kMotion, step and step + 1: the same bytes with any number
  /// of threads.
  void move(const Pose2& T_before_after, const MotionNoise& noise, std::uint64_t seed, std::uint64_t step, int threads,
            ParticleSet* particles);
  /// Follows a resampling. @param parent  each new particle's old index
  void resample(const std::vector<std::uint32_t>& parent);

  /// Their means over the particles: share, rad/m, share.
  Eigen::Vector3d mean() const;
  /// Standard deviations given one path.
  Eigen::Vector3d sd() const;

 private:
  void age(double moved_m);

  SteadyErrorsConfig config_;
  std::vector<double> distance_scale_, turn_per_m_, turn_scale_;  ///< means, one per particle
  double distance_variance_ = 0.0;
  Eigen::Matrix2d turn_covariance_ = Eigen::Matrix2d::Zero();  ///< of turn_per_m and turn_scale
  std::vector<double> scratch_, cosine_, sine_;
};

}  // namespace knav
