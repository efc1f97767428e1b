#include "tsdf_local_mapper/steady_errors.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/fast_math.h"
#include "core/parts.h"
#include "core/random.h"

namespace knav {
namespace {
constexpr double kRadiusOfTurning_m = 0.3;  ///< a turn counts as this much driving per radian
}  // namespace

SteadyErrors::SteadyErrors(const SteadyErrorsConfig& config) : config_(config) {}

void SteadyErrors::forget(std::size_t particles) {
  for (std::vector<double>* field : {&distance_scale_, &turn_per_m_, &turn_scale_}) field->assign(particles, 0.0);
  distance_variance_ = config_.distance_scale_sd * config_.distance_scale_sd;
  turn_covariance_ = Eigen::Vector2d(config_.turn_per_m_sd * config_.turn_per_m_sd,
                                     config_.turn_scale_sd * config_.turn_scale_sd)
                         .asDiagonal();
}

void SteadyErrors::age(double moved_m) {
  const double keep = std::exp(-moved_m / config_.memory_m), fresh = 1.0 - keep * keep;
  for (std::vector<double>* field : {&distance_scale_, &turn_per_m_, &turn_scale_}) {
    for (double& value : *field) value *= keep;
  }
  distance_variance_ =
      keep * keep * distance_variance_ + fresh * config_.distance_scale_sd * config_.distance_scale_sd;
  turn_covariance_ *= keep * keep;
  turn_covariance_(0, 0) += fresh * config_.turn_per_m_sd * config_.turn_per_m_sd;
  turn_covariance_(1, 1) += fresh * config_.turn_scale_sd * config_.turn_scale_sd;
}

void SteadyErrors::move(const Pose2& T, const MotionNoise& noise, std::uint64_t seed, std::uint64_t step, int threads,
                        ParticleSet* particles) {
  const std::size_t count = particles->size();
  const double distance = std::hypot(T.x_m, T.y_m);
  age(distance + kRadiusOfTurning_m * std::fabs(T.yaw_rad));
  // Along the way: noise and scale both lengthen the step; what a path shows of their sum tells of the scale.
  const double ux = distance > 0.0 ? T.x_m / distance : 1.0, uy = distance > 0.0 ? T.y_m / distance : 0.0;
  const double along_variance = ux * ux * noise.forward_m * noise.forward_m + uy * uy * noise.sideways_m * noise.sideways_m;
  const double scale_sd = std::sqrt(distance_variance_) * distance;
  const double along_total = along_variance + scale_sd * scale_sd;
  const double scale_gain = along_total > 0.0 ? distance_variance_ * distance / along_total : 0.0;
  // The same for the turn, which depends on two errors.
  const Eigen::Vector2d h(T.x_m, T.yaw_rad);
  const Eigen::Vector2d ph = turn_covariance_ * h;
  const double steady_turn_variance = std::max(0.0, h.dot(ph)), steady_turn_sd = std::sqrt(steady_turn_variance);
  const double turn_total = steady_turn_variance + noise.turn_rad * noise.turn_rad;
  const Eigen::Vector2d turn_gain = turn_total > 0.0 ? Eigen::Vector2d(ph / turn_total) : Eigen::Vector2d::Zero();

  cosine_.resize(count);
  sine_.resize(count);
  cos_sin(particles->yaw_rad.data(), count, cosine_.data(), sine_.data());
  in_parts(count, threads, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      double white[3], steady[3];
      three_normals(seed, random_stream::kMotion, step, static_cast<std::uint32_t>(i), white);
      three_normals(seed, random_stream::kMotion, step + 1, static_cast<std::uint32_t>(i), steady);
      const double lengthened = scale_sd * steady[0];
      const double ex = lengthened * ux + noise.forward_m * white[0], ey = lengthened * uy + noise.sideways_m * white[1];
      const double turned = steady_turn_sd * steady[1] + noise.turn_rad * white[2];
      const double x = T.x_m * (1.0 + distance_scale_[i]) + ex, y = T.y_m * (1.0 + distance_scale_[i]) + ey;
      const double yaw = particles->yaw_rad[i] + T.yaw_rad * (1.0 + turn_scale_[i]) + T.x_m * turn_per_m_[i] + turned;
      particles->set(i, {particles->x_m[i] + cosine_[i] * x - sine_[i] * y,
                         particles->y_m[i] + sine_[i] * x + cosine_[i] * y, yaw - 2.0 * kPi * rounded(yaw / (2.0 * kPi))});
      distance_scale_[i] += scale_gain * (ex * ux + ey * uy);
      turn_per_m_[i] += turn_gain[0] * turned;
      turn_scale_[i] += turn_gain[1] * turned;
    }
  });
  distance_variance_ -= scale_gain * distance * distance_variance_;
  turn_covariance_ -= turn_gain * ph.transpose();
  turn_covariance_ = (0.5 * (turn_covariance_ + turn_covariance_.transpose())).eval();
}

void SteadyErrors::resample(const std::vector<std::uint32_t>& parent) {
  for (std::vector<double>* field : {&distance_scale_, &turn_per_m_, &turn_scale_}) {
    scratch_.resize(parent.size());
    for (std::size_t i = 0; i < parent.size(); ++i) scratch_[i] = (*field)[parent[i]];
    field->swap(scratch_);
  }
}

Eigen::Vector3d SteadyErrors::mean() const {
  const auto of = [](const std::vector<double>& field) {
    return std::accumulate(field.begin(), field.end(), 0.0) / static_cast<double>(std::max<std::size_t>(1, field.size()));
  };
  return {of(distance_scale_), of(turn_per_m_), of(turn_scale_)};
}

Eigen::Vector3d SteadyErrors::sd() const {
  return {std::sqrt(distance_variance_), std::sqrt(turn_covariance_(0, 0)), std::sqrt(turn_covariance_(1, 1))};
}

}  // namespace knav
