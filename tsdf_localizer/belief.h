#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "core/particle_filter.h"
#include "tsdf_localizer/global_search.h"
#include "tsdf_localizer/localizer_config.h"
#include "tsdf_localizer/price_field.h"

namespace knav {

/// Where the particles say the robot is: their best cluster, and how much of the weight is elsewhere.
struct BeliefEstimate {
  PoseEstimate pose;  ///< of the best cluster; covariance of all particles about it if that is ambiguous
  double cluster_weight = 0.0;  ///< of the best cluster, in [0, 1]
  std::size_t clusters = 0;     ///< that hold more than 2 % of the weight
};

/// The particle filter: weighted poses, moved with noise, weighed by the price of a scan, resampled when few
/// of them hold the weight, as many as the spread needs (KLD sampling, Fox 2003).
class Belief {
 public:
  explicit Belief(const LocalizerConfig& config);

  bool empty() const { return particles_.size() == 0; }
  void clear();
  void spread_around(const Pose2& T_map_base, const Eigen::Matrix3d& covariance);
  void move(const Pose2& T_before_after);
  /// Half of the particles get extra noise; the others stay for the case that nothing happened.
  void widen(double sd_m, double sd_rad);
  /// Weighs by the price of the scan, then resamples if the weights have become uneven. A `temperature` that
  /// is high tempers evidence already used.
  void weigh(const PriceField& field, const WeightedPoints& points, double temperature);
  /// Gives `fraction` of the weight to new particles around the hypotheses, each by its price.
  void inject(const std::vector<Hypothesis>& hypotheses, double fraction, double temperature);

  const ParticleSet& particles() const { return particles_; }
  /// Of the state after the last change.
  const BeliefEstimate& estimate();

 private:
  void resample(std::size_t count);
  std::size_t find_clusters();
  std::size_t wanted_count(std::size_t bins) const;

  LocalizerConfig config_;
  ParticleSet particles_, old_;
  BeliefEstimate estimate_;
  bool stale_ = true;
  std::uint64_t step_ = 0;  ///< of the random streams
  std::vector<float> cost_;
  std::vector<std::pair<std::uint64_t, std::uint32_t>> bin_of_;  ///< (bin, particle), sorted by bin
  std::vector<std::uint64_t> bins_;
  std::vector<std::uint32_t> first_, cluster_of_bin_, open_;
  std::vector<std::uint32_t> cluster_of_;  ///< per particle
  std::vector<double> cluster_weight_;
};

}  // namespace knav
