#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/particle_filter.h"
#include "core/pose2.h"

namespace knav {

/// What may be steadily wrong with odometry: wheels of another size, another distance between them, a skewed mount.
struct SteadyErrorsConfig {
  double memory_m = 0.0;
  double distance_scale_sd = 0.03;
  double turn_per_m_sd = 0.02;
  double turn_scale_sd = 0.05;

  template <class Visitor>
  void visit(Visitor& v) {
    v.number("memory_m", memory_m, 0, 100000, "m",
             "Distance over which the errors may change; 0 = none is assumed.");
    v.number("distance_scale_sd", distance_scale_sd, 0, 0.5, "", "Distances are wrong by this share (sd).");
    v.number("turn_per_m_sd", turn_per_m_sd, 0, 1, "rad/m", "Driving straight on it turns this much (sd).");
    v.number("turn_scale_sd", turn_scale_sd, 0, 0.5, "", "Turns are wrong by this share (sd).");
  }
};

/// The steady errors of odometry, one idea of them per particle. Hypotheses with the right errors stay where the view
/// tells the motion, and carry what they know on to where it tells nothing: along a corridor whose end is too far to be
/// measured well. The errors wander slowly (Ornstein-Uhlenbeck), so that their spread returns to the prior's.
class SteadyErrors {
 public:
  SteadyErrors(const SteadyErrorsConfig& config, std::uint64_t seed) : config_(config), seed_(seed) {}

  /// As if nothing were known of them.
  void draw(std::size_t particles, std::uint64_t step);
  /// Moves each particle, which odometry's step has already moved, by what its errors make of that step.
  void apply(const Pose2& T_before_after, std::uint64_t step, ParticleSet* particles);
  /// Follows a resampling. @param parent  each new particle's old index
  void resample(const std::vector<std::uint32_t>& parent);

 private:
  void normals(std::uint64_t step, std::size_t particle, double out[3]) const;

  SteadyErrorsConfig config_;
  std::uint64_t seed_;
  std::vector<double> distance_scale_, turn_per_m_, turn_scale_;  ///< one per particle
  std::vector<double> scratch_, cosine_, sine_;
};

}  // namespace knav
