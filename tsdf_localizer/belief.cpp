#include "tsdf_localizer/belief.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/motion_model.h"
#include "core/random.h"

namespace knav {
namespace {

constexpr double kBin_m = 0.5;
constexpr std::uint64_t kHeadings = 18;  ///< bins of 20 deg
constexpr std::uint64_t kAxis = 1u << 20, kOffset = kAxis / 2;
constexpr std::uint32_t kNone = 0xffffffffu;
constexpr double kInjectSd_m = 0.08, kInjectSd_rad = 0.03;

std::uint64_t bin_key(std::uint64_t x, std::uint64_t y, std::uint64_t heading) {
  return (x * kAxis + y) * kHeadings + heading;
}

std::uint64_t bin_of_pose(const Pose2& pose) {
  const auto along = [](double v) {
    return static_cast<std::uint64_t>(std::clamp(std::floor(v / kBin_m) + static_cast<double>(kOffset), 1.0,
                                                 static_cast<double>(kAxis) - 2.0));
  };
  const double turn = (normalize_angle_rad(pose.yaw_rad) + kPi) / (2.0 * kPi);
  const auto heading = static_cast<std::uint64_t>(turn * static_cast<double>(kHeadings)) % kHeadings;
  return bin_key(along(pose.x_m), along(pose.y_m), heading);
}

}  // namespace

Belief::Belief(const LocalizerConfig& config) : config_(config) {}

void Belief::clear() {
  particles_.resize(0);
  stale_ = true;
}

void Belief::spread_around(const Pose2& T_map_base, const Eigen::Matrix3d& covariance) {
  if (!is_finite(T_map_base) || !covariance.allFinite()) {
    throw UserError("initial pose: it has values that are not finite; give numbers.");
  }
  // by the eigenvectors, so that a covariance that is singular, or a little off symmetric, is good enough
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(0.5 * (covariance + covariance.transpose()));
  const Eigen::Matrix3d root =
      solver.eigenvectors() * solver.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  const auto count = static_cast<std::size_t>(config_.max_particles);
  ++step_;
  particles_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    RandomStream random(static_cast<std::uint64_t>(config_.seed), random_stream::kLocalizerGlobal, step_,
                        static_cast<std::uint32_t>(i));
    Eigen::Vector3d z;
    for (int k = 0; k < 3; ++k) z[k] = random.normal();
    const Eigen::Vector3d d = root * z;
    particles_.set(
        i, {T_map_base.x_m + d[0], T_map_base.y_m + d[1], normalize_angle_rad(T_map_base.yaw_rad + d[2])});
  }
  particles_.weight.assign(count, 1.0 / static_cast<double>(count));
  stale_ = true;
}

void Belief::move(const Pose2& T_before_after) {
  sample_motion(config_.motion, T_before_after, static_cast<std::uint64_t>(config_.seed),
                random_stream::kLocalizerMotion, ++step_, particles_);
  estimate_.pose.mean = estimate_.pose.mean * T_before_after;  // for estimate() to find its last cluster by
  stale_ = true;
}

void Belief::widen(double sd_m, double sd_rad) {
  ++step_;
  for (std::size_t i = 0; i < particles_.size(); i += 2) {
    RandomStream random(static_cast<std::uint64_t>(config_.seed), random_stream::kRecovery, step_,
                        static_cast<std::uint32_t>(i));
    const double x = random.normal(0.0, sd_m), y = random.normal(0.0, sd_m), yaw = random.normal(0.0, sd_rad);
    particles_.set(i, particles_.pose(i) * Pose2{x, y, yaw});
  }
  stale_ = true;
}

void Belief::weigh(const PriceField& field, const WeightedPoints& points, double temperature) {
  if (empty() || points.size() == 0) return;
  mean_prices(field, points, particles_, &cost_);
  weigh_by_cost(particles_, cost_, temperature);
  stale_ = true;
  const auto count = particles_.size();
  const bool uneven = effective_sample_size(particles_) < config_.resample_below * static_cast<double>(count);
  const std::size_t wanted = wanted_count(find_clusters());
  if (uneven || wanted < count * 7 / 10) resample(wanted);
}

void Belief::resample(std::size_t count) {
  ++step_;
  RandomStream random(static_cast<std::uint64_t>(config_.seed), random_stream::kLocalizerResample, step_, 0);
  resample_low_variance(particles_, count, random.uniform());
  stale_ = true;
}

void Belief::inject(const std::vector<Hypothesis>& hypotheses, double fraction, double temperature) {
  if (hypotheses.empty()) return;
  const auto total = static_cast<std::size_t>(config_.max_particles);
  std::size_t kept = 0;
  if (empty()) {
    fraction = 1.0;
  } else {
    kept = static_cast<std::size_t>((1.0 - fraction) * static_cast<double>(total));
    if (kept > 0) resample(kept);
  }
  std::vector<double> share(hypotheses.size());
  double sum = 0.0;
  for (std::size_t h = 0; h < hypotheses.size(); ++h) {
    share[h] = std::exp((hypotheses.front().cost - hypotheses[h].cost) / temperature);
    sum += share[h];
  }
  ++step_;
  const std::size_t added = total - kept;
  particles_.resize(total);
  std::size_t h = 0;
  double upto = share[0] / sum;
  for (std::size_t k = 0; k < added; ++k) {
    while ((static_cast<double>(k) + 0.5) / static_cast<double>(added) > upto && h + 1 < hypotheses.size()) {
      upto += share[++h] / sum;
    }
    RandomStream random(static_cast<std::uint64_t>(config_.seed), random_stream::kLocalizerGlobal, step_,
                        static_cast<std::uint32_t>(k));
    const double x = random.normal(0.0, kInjectSd_m), y = random.normal(0.0, kInjectSd_m);
    particles_.set(kept + k, hypotheses[h].T_map_base * Pose2{x, y, random.normal(0.0, kInjectSd_rad)});
  }
  const double kept_weight = kept > 0 ? (1.0 - fraction) / static_cast<double>(kept) : 0.0;
  const double added_weight = added > 0 ? (kept > 0 ? fraction : 1.0) / static_cast<double>(added) : 0.0;
  for (std::size_t i = 0; i < total; ++i) particles_.weight[i] = i < kept ? kept_weight : added_weight;
  normalize_weights(particles_);
  stale_ = true;
}

std::size_t Belief::wanted_count(std::size_t bins) const {
  const auto low = static_cast<double>(config_.min_particles),
             high = static_cast<double>(config_.max_particles);
  if (bins < 2) return static_cast<std::size_t>(config_.min_particles);
  const double k = static_cast<double>(bins) - 1.0, a = 2.0 / (9.0 * k);
  const double root = 1.0 - a + std::sqrt(a) * config_.kld_z;
  return static_cast<std::size_t>(
      std::clamp(std::ceil(k / (2.0 * config_.kld_err) * root * root * root), low, high));
}

/// Bins of particles that touch (26 neighbours) are one cluster. Returns the number of bins.
std::size_t Belief::find_clusters() {
  const std::size_t count = particles_.size();
  bin_of_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    bin_of_[i] = {bin_of_pose(particles_.pose(i)), static_cast<std::uint32_t>(i)};
  }
  std::sort(bin_of_.begin(), bin_of_.end());
  bins_.clear();
  first_.clear();
  for (std::size_t i = 0; i < count; ++i) {
    if (i > 0 && bin_of_[i].first == bin_of_[i - 1].first) continue;
    bins_.push_back(bin_of_[i].first);
    first_.push_back(static_cast<std::uint32_t>(i));
  }
  first_.push_back(static_cast<std::uint32_t>(count));
  cluster_of_bin_.assign(bins_.size(), kNone);
  cluster_of_.assign(count, 0);
  cluster_weight_.clear();
  for (std::size_t seed = 0; seed < bins_.size(); ++seed) {
    if (cluster_of_bin_[seed] != kNone) continue;
    const auto cluster = static_cast<std::uint32_t>(cluster_weight_.size());
    cluster_weight_.push_back(0.0);
    cluster_of_bin_[seed] = cluster;
    open_.assign(1, static_cast<std::uint32_t>(seed));
    while (!open_.empty()) {
      const std::uint32_t b = open_.back();
      open_.pop_back();
      for (std::uint32_t i = first_[b]; i < first_[b + 1]; ++i) {
        cluster_of_[bin_of_[i].second] = cluster;
        cluster_weight_[cluster] += particles_.weight[bin_of_[i].second];
      }
      const std::uint64_t heading = bins_[b] % kHeadings, y = bins_[b] / kHeadings % kAxis,
                          x = bins_[b] / kHeadings / kAxis;
      for (std::uint64_t nx = x - 1; nx <= x + 1; ++nx) {
        for (std::uint64_t ny = y - 1; ny <= y + 1; ++ny) {
          for (std::uint64_t turn = kHeadings - 1; turn <= kHeadings + 1; ++turn) {
            const std::uint64_t key = bin_key(nx, ny, (heading + turn) % kHeadings);
            const auto found = std::lower_bound(bins_.begin(), bins_.end(), key);
            if (found == bins_.end() || *found != key) continue;
            const auto n = static_cast<std::uint32_t>(found - bins_.begin());
            if (cluster_of_bin_[n] != kNone) continue;
            cluster_of_bin_[n] = cluster;
            open_.push_back(n);
          }
        }
      }
    }
  }
  return bins_.size();
}

const BeliefEstimate& Belief::estimate() {
  if (!stale_) return estimate_;
  stale_ = false;
  const Pose2 before = estimate_.pose.mean;
  const bool had_one = estimate_.cluster_weight > 0.0;
  estimate_ = BeliefEstimate();
  if (empty()) return estimate_;
  find_clusters();
  const auto heaviest = static_cast<std::size_t>(
      std::max_element(cluster_weight_.begin(), cluster_weight_.end()) - cluster_weight_.begin());
  // Of two clusters that are about as heavy, the one the last estimate lay in, so that map->odom does not
  // jump to and fro between them.
  std::size_t best = heaviest;
  if (had_one) {
    const auto here = std::lower_bound(bins_.begin(), bins_.end(), bin_of_pose(before));
    if (here != bins_.end() && *here == bin_of_pose(before)) {
      const std::size_t mine = cluster_of_bin_[static_cast<std::size_t>(here - bins_.begin())];
      if (cluster_weight_[mine] > 0.7 * cluster_weight_[heaviest]) best = mine;
    }
  }
  for (const double w : cluster_weight_) estimate_.clusters += w > 0.02;
  estimate_.cluster_weight = cluster_weight_[best];
  old_.resize(0);
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    if (cluster_of_[i] != best) continue;
    old_.x_m.push_back(particles_.x_m[i]);
    old_.y_m.push_back(particles_.y_m[i]);
    old_.yaw_rad.push_back(particles_.yaw_rad[i]);
    old_.weight.push_back(particles_.weight[i]);
  }
  estimate_.pose = weighted_mean(old_);
  if (estimate_.cluster_weight < config_.health.ok_cluster_weight) {
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < particles_.size(); ++i) {
      const Eigen::Vector3d d(particles_.x_m[i] - estimate_.pose.mean.x_m,
                              particles_.y_m[i] - estimate_.pose.mean.y_m,
                              normalize_angle_rad(particles_.yaw_rad[i] - estimate_.pose.mean.yaw_rad));
      spread += particles_.weight[i] * d * d.transpose();
    }
    estimate_.pose.covariance = spread;
  }
  return estimate_;
}

}  // namespace knav
