#pragma once

#include <cstdint>
#include <vector>

#include "core/motion_model.h"
#include "core/particle_filter.h"
#include "core/tsdf_grid.h"
#include "core/weighted_points.h"
#include "tsdf_local_mapper/local_mapper_config.h"
#include "tsdf_local_mapper/odometry_timing.h"
#include "tsdf_local_mapper/steady_errors.h"

namespace knav {

/// The multi-hypothesis search over the robot's pose of paper section III.E: a particle filter whose
/// observation model is the alignment cost on the signed distance map.
class PoseFilter {
 public:
  PoseFilter(const FilterConfig& config, const MotionModelConfig& motion, const SteadyErrorsConfig& errors,
             const OdometryTimingConfig& timing, std::uint64_t seed);

  /// All particles at one pose. What was learned of odometry's errors stays: it is the same robot.
  void start_at(const Pose2& pose, double stamp_s);
  /// Odometry's step with its noise.
  void predict(const Pose2& T_before_after, double dt_s);
  /// Weighs the particles by how well the readings fit, refines them, and leaves the estimate in mean() etc.
  /// Sets the readings' weights.
  /// @param evidence  in (0, 1], how much of the frame is new
  void update(const TsdfGrid& grid, WeightedPoints* points_robot, double stamp_s, double evidence = 1.0);
  /// The estimate without a measurement.
  void estimate_from_particles();
  /// Moves all particles and the estimate rigidly, without noise.
  void shift(const Pose2& T_before_after);

  const Pose2& mean() const { return mean_; }
  const Eigen::Matrix3d& covariance() const { return covariance_; }
  double mean_cost() const { return mean_cost_; }
  double effective_particles() const { return effective_; }
  /// How long the last generation of hypotheses lived: until nine in ten had no descendants left.
  double lifespan_s() const { return lifespan_s_; }
  /// How far off odometry's stamps usually are (sd).
  double odometry_stamp_sd_s() const { return timing_.sd_s(); }
  const ParticleSet& particles() const { return particles_; }

 private:
  void weigh(const TsdfGrid& grid, const WeightedPoints& points, double share);
  double temperature() const;
  void jitter(const Pose2& center, const Eigen::Matrix3d& covariance, double width);
  void resample();
  void track_ancestors(double stamp_s);

  FilterConfig config_;
  MotionModelConfig motion_;
  std::uint64_t seed_;
  std::uint64_t step_ = 0;
  SteadyErrors odometry_errors_;
  OdometryTiming timing_;
  ParticleSet particles_;
  std::vector<float> cost_;
  std::vector<std::uint32_t> parent_, ancestor_, ancestor_scratch_;
  double lifespan_s_ = 0.0, mark_stamp_s_ = 0.0;
  Pose2 mean_;
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();
  double mean_cost_ = 0.0, effective_ = 0.0;
};

}  // namespace knav
