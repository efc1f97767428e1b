#include "tsdf_local_mapper/odometry_timing.h"

#include <algorithm>
#include <cmath>

#include "core/fast_math.h"
#include "core/random.h"

namespace knav {
namespace {
constexpr double kVelocityMemory_s = 0.3;  // a single step's velocity is itself off by what the stamps are
constexpr double kMoving_mps = 0.1, kMoving_radps = 0.1;  // standing tells nothing
constexpr double kLeast_s = 1e-4;
constexpr double kFewest = 20.0;                          // frames that the given sd counts for
}  // namespace

void OdometryTiming::forget(std::size_t particles) { late_s_.assign(particles, 0.0); }

void OdometryTiming::move(double direction, ParticleSet* particles) {
  const std::size_t count = late_s_.size();
  for (std::vector<double>* field : {&scratch_, &cosine_, &sine_}) field->resize(count);
  // Along the arc's chord.
  for (std::size_t i = 0; i < count; ++i) scratch_[i] = particles->yaw_rad[i] + 0.5 * direction * late_s_[i] * turn_radps_;
  cos_sin(scratch_.data(), count, cosine_.data(), sine_.data());
  for (std::size_t i = 0; i < count; ++i) {
    const double t_s = direction * late_s_[i], x = t_s * forward_mps_, y = t_s * sideways_mps_;
    const double yaw = particles->yaw_rad[i] + t_s * turn_radps_;
    particles->set(i, {particles->x_m[i] + cosine_[i] * x - sine_[i] * y, particles->y_m[i] + sine_[i] * x + cosine_[i] * y,
                       yaw - 2.0 * kPi * rounded(yaw / (2.0 * kPi))});
  }
}

void OdometryTiming::take_out(ParticleSet* particles) { move(-1.0, particles); }

void OdometryTiming::add(const Pose2& T, double dt_s, std::uint64_t seed, std::uint64_t step, ParticleSet* particles) {
  const double fresh = 1.0 - std::exp(-dt_s / kVelocityMemory_s);
  forward_mps_ += fresh * (T.x_m / dt_s - forward_mps_);
  sideways_mps_ += fresh * (T.y_m / dt_s - sideways_mps_);
  turn_radps_ += fresh * (T.yaw_rad / dt_s - turn_radps_);
  for (std::size_t i = 0; i < late_s_.size(); ++i) {
    double normal[3];
    three_normals(seed, random_stream::kOdometryTiming, step, static_cast<std::uint32_t>(i), normal);
    late_s_[i] = sd_s_ * normal[0];
  }
  move(1.0, particles);
}

void OdometryTiming::learn(const std::vector<double>& weight) {
  if (late_s_.empty() || (std::hypot(forward_mps_, sideways_mps_) < kMoving_mps && std::fabs(turn_radps_) < kMoving_radps)) return;
  double square = 0.0;
  for (std::size_t i = 0; i < late_s_.size(); ++i) square += weight[i] * late_s_[i] * late_s_[i];
  frames_ = std::min(frames_ + 1.0, kMemory);
  const double fresh = 1.0 / (frames_ + kFewest);
  sd_s_ = std::clamp(std::sqrt((1.0 - fresh) * sd_s_ * sd_s_ + fresh * square), kLeast_s, config_.stamp_sd_s);
}

void OdometryTiming::resample(const std::vector<std::uint32_t>& parent) {
  if (late_s_.empty()) return;
  scratch_.resize(parent.size());
  for (std::size_t i = 0; i < parent.size(); ++i) scratch_[i] = late_s_[parent[i]];
  late_s_.swap(scratch_);
}

}  // namespace knav
