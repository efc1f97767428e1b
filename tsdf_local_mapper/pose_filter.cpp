#include "tsdf_local_mapper/pose_filter.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/fast_math.h"
#include "core/random.h"
#include "core/tsdf_alignment.h"

namespace knav {
namespace {
constexpr int kHypotheses = 24;

/// What share of a frame's readings has a say.
double mean_weight(const WeightedPoints& points) {
  const double sum = std::accumulate(points.weight.begin(), points.weight.end(), 0.0);
  return std::max(1e-3, sum / static_cast<double>(points.size()));
}
}  // namespace

PoseFilter::PoseFilter(const FilterConfig& config, const MotionModelConfig& motion, const SteadyErrorsConfig& errors,
                       const OdometryTimingConfig& timing, std::uint64_t seed)
    : config_(config), motion_(motion), seed_(seed), odometry_errors_(errors), timing_(timing) {
  particles_.resize(static_cast<std::size_t>(config.particles));
  odometry_errors_.forget(particles_.size());
  ancestor_.resize(particles_.size());
  start_at(Pose2{}, 0.0);
}

void PoseFilter::start_at(const Pose2& pose, double stamp_s) {
  for (std::size_t i = 0; i < particles_.size(); ++i) particles_.set(i, pose);
  std::fill(particles_.weight.begin(), particles_.weight.end(), 1.0 / static_cast<double>(particles_.size()));
  for (std::size_t i = 0; i < ancestor_.size(); ++i) ancestor_[i] = static_cast<std::uint32_t>(i);
  if (timing_.on()) timing_.forget(particles_.size());
  mark_stamp_s_ = stamp_s;
  mean_ = pose;
  covariance_.setZero();
  mean_cost_ = std::numeric_limits<double>::quiet_NaN();
  effective_ = static_cast<double>(particles_.size());
}

void PoseFilter::predict(const Pose2& T_before_after, double dt_s) {
  const bool timed = timing_.on() && dt_s > 0.0;
  if (timed) timing_.take_out(&particles_);
  const std::uint64_t step = step_;
  if (!odometry_errors_.on()) {
    sample_motion(motion_, T_before_after, seed_, random_stream::kMotion, step_++, particles_);
  } else {
    odometry_errors_.move(T_before_after, motion_noise(motion_, T_before_after), seed_, step_, config_.threads, &particles_);
    step_ += 2;
  }
  if (timed) timing_.add(T_before_after, dt_s, seed_, step, &particles_);
}

void PoseFilter::shift(const Pose2& T_before_after) {
  for (std::size_t i = 0; i < particles_.size(); ++i) particles_.set(i, particles_.pose(i) * T_before_after);
  mean_ = mean_ * T_before_after;
}

void PoseFilter::estimate_from_particles() {
  const PoseEstimate estimate = weighted_mean(particles_);
  mean_ = estimate.mean;
  covariance_ = estimate.covariance;
  effective_ = effective_sample_size(particles_);
  mean_cost_ = std::numeric_limits<double>::quiet_NaN();
}

double PoseFilter::temperature() const {
  if (config_.misfit_cost <= 0.0) return config_.temperature;
  const float best = *std::min_element(cost_.begin(), cost_.end());
  return config_.temperature * (1.0 + static_cast<double>(best) / config_.misfit_cost);
}

void PoseFilter::weigh(const TsdfGrid& grid, const WeightedPoints& points, double share) {
  if (config_.alignment_cost == "paper") {
    float mean_weight = 0.0f;
    tsdf_paper_costs(grid, points, particles_, &cost_, &mean_weight);
    const double temperature = config_.paper_temperature * std::max(1e-6, static_cast<double>(mean_weight)) *
                               static_cast<double>(points.size());
    weigh_by_cost(particles_, cost_, temperature / share);
    for (float& cost : cost_) {
      cost /= std::max(1e-6f, mean_weight) * static_cast<float>(std::max<std::size_t>(1, points.size()));
    }
  } else {
    tsdf_alignment_costs(grid, points, particles_, static_cast<float>(config_.unknown_price), &cost_, config_.threads);
    weigh_by_cost(particles_, cost_, temperature() / share);
  }
}

void PoseFilter::resample() {
  RandomStream random(seed_, random_stream::kResample, step_++, 0);
  resample_low_variance(particles_, static_cast<std::size_t>(config_.particles), random.uniform(), &parent_);
  ancestor_scratch_.resize(parent_.size());
  for (std::size_t i = 0; i < parent_.size(); ++i) ancestor_scratch_[i] = ancestor_[parent_[i]];
  ancestor_.swap(ancestor_scratch_);
  odometry_errors_.resample(parent_);
  timing_.resample(parent_);
}

void PoseFilter::jitter(const Pose2& center, const Eigen::Matrix3d& covariance, double width) {
  // A little more than the spread itself, so that it never collapses below what the grid resolves.
  Eigen::Matrix3d floor = Eigen::Matrix3d::Zero();
  floor.diagonal() << 4e-6, 4e-6, 1e-6;
  const Eigen::Matrix3d root = Eigen::LLT<Eigen::Matrix3d>(covariance * width * width + floor).matrixL();
  // Shrinking towards the mean first keeps the spread as it is (Liu and West).
  const double keep = std::sqrt(std::max(0.0, 1.0 - width * width));
  for (std::size_t i = 0; i < particles_.size(); ++i) {
    double n[3];
    three_normals(seed_, random_stream::kMotion, step_, static_cast<std::uint32_t>(i), n);
    const Pose2 p = particles_.pose(i);
    const double turn = p.yaw_rad - center.yaw_rad;
    const double yaw = center.yaw_rad + keep * (turn - 2.0 * kPi * rounded(turn / (2.0 * kPi))) + root(2, 0) * n[0] +
                       root(2, 1) * n[1] + root(2, 2) * n[2];
    particles_.set(i, {center.x_m + keep * (p.x_m - center.x_m) + root(0, 0) * n[0],
                       center.y_m + keep * (p.y_m - center.y_m) + root(1, 0) * n[0] + root(1, 1) * n[1],
                       yaw - 2.0 * kPi * rounded(yaw / (2.0 * kPi))});
  }
  ++step_;
}

void PoseFilter::update(const TsdfGrid& grid, WeightedPoints* readings, double stamp_s, double evidence) {
  if (config_.alignment_cost == "normalized") weigh_by_known_share(grid, particles_, kHypotheses, readings);
  const WeightedPoints& points = *readings;
  evidence *= mean_weight(points);
  // Annealing: the likelihood enters in shares that sum to 1, the last and largest on the finest samples.
  double total = 0.0, share = 1.0;
  for (int r = 0; r <= config_.refinements; ++r, share *= 3.0) total += share;
  share = 1.0 / total;
  PoseEstimate estimate;
  for (int r = 0; r <= config_.refinements; ++r, share *= 3.0) {
    if (r > 0) {
      resample();
      jitter(estimate.mean, estimate.covariance, 0.5);
    }
    weigh(grid, points, share * evidence);
    estimate = weighted_mean(particles_);
  }
  mean_ = estimate.mean;
  covariance_ = estimate.covariance;
  effective_ = effective_sample_size(particles_);
  mean_cost_ = 0.0;
  for (std::size_t i = 0; i < particles_.size(); ++i) mean_cost_ += particles_.weight[i] * cost_[i];
  timing_.learn(particles_.weight);
  if (effective_ < 0.5 * static_cast<double>(particles_.size())) resample();
  track_ancestors(stamp_s);
}

void PoseFilter::track_ancestors(double stamp_s) {
  // Resampling keeps the order, so descendants of one ancestor lie side by side.
  std::size_t families = 1;
  for (std::size_t i = 1; i < ancestor_.size(); ++i) families += ancestor_[i] != ancestor_[i - 1] ? 1 : 0;
  if (10 * families > ancestor_.size()) return;
  lifespan_s_ = stamp_s - mark_stamp_s_;
  mark_stamp_s_ = stamp_s;
  for (std::size_t i = 0; i < ancestor_.size(); ++i) ancestor_[i] = static_cast<std::uint32_t>(i);
}

}  // namespace knav
