#include "tsdf_local_mapper/steady_errors.h"

#include <cmath>

#include "core/fast_math.h"
#include "core/random.h"

namespace knav {
namespace {
constexpr double kRadiusOfTurning_m = 0.3;  ///< a turn counts as this much driving per radian
}  // namespace

void SteadyErrors::normals(std::uint64_t step, std::size_t particle, double out[3]) const {
  three_normals(seed_, random_stream::kOdometryErrors, step, static_cast<std::uint32_t>(particle), out);
}

void SteadyErrors::draw(std::size_t particles, std::uint64_t step) {
  for (std::vector<double>* field : {&distance_scale_, &turn_per_m_, &turn_scale_}) field->resize(particles);
  for (std::size_t i = 0; i < particles; ++i) {
    double n[3];
    normals(step, i, n);
    distance_scale_[i] = config_.distance_scale_sd * n[0];
    turn_per_m_[i] = config_.turn_per_m_sd * n[1];
    turn_scale_[i] = config_.turn_scale_sd * n[2];
  }
}

void SteadyErrors::apply(const Pose2& T, std::uint64_t step, ParticleSet* particles) {
  if (config_.memory_m <= 0.0) return;
  const std::size_t count = particles->size();
  const double moved = std::hypot(T.x_m, T.y_m) + kRadiusOfTurning_m * std::fabs(T.yaw_rad);
  const double keep = std::exp(-moved / config_.memory_m), fresh = std::sqrt(1.0 - keep * keep);
  cosine_.resize(count);
  sine_.resize(count);
  cos_sin(particles->yaw_rad.data(), count, cosine_.data(), sine_.data());
  for (std::size_t i = 0; i < count; ++i) {
    double n[3];
    normals(step, i, n);
    distance_scale_[i] = keep * distance_scale_[i] + fresh * config_.distance_scale_sd * n[0];
    turn_per_m_[i] = keep * turn_per_m_[i] + fresh * config_.turn_per_m_sd * n[1];
    turn_scale_[i] = keep * turn_scale_[i] + fresh * config_.turn_scale_sd * n[2];
    const double x = distance_scale_[i] * T.x_m, y = distance_scale_[i] * T.y_m;
    const double yaw = particles->yaw_rad[i] + turn_scale_[i] * T.yaw_rad + turn_per_m_[i] * T.x_m;
    particles->set(i, {particles->x_m[i] + cosine_[i] * x - sine_[i] * y,
                       particles->y_m[i] + sine_[i] * x + cosine_[i] * y, yaw - 2.0 * kPi * rounded(yaw / (2.0 * kPi))});
  }
}

void SteadyErrors::resample(const std::vector<std::uint32_t>& parent) {
  for (std::vector<double>* field : {&distance_scale_, &turn_per_m_, &turn_scale_}) {
    scratch_.resize(parent.size());
    for (std::size_t i = 0; i < parent.size(); ++i) scratch_[i] = (*field)[parent[i]];
    field->swap(scratch_);
  }
}

}  // namespace knav
