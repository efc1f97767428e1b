#include "core/particle_filter.h"

#include <algorithm>
#include <cmath>

#include "core/fast_math.h"

namespace knav {

void ParticleSet::resize(std::size_t count) {
  x_m.resize(count);
  y_m.resize(count);
  yaw_rad.resize(count);
  weight.resize(count);
}

bool normalize_weights(ParticleSet& particles) {
  double sum = 0.0;
  for (const double w : particles.weight) sum += w;
  if (!(sum > 0.0) || !std::isfinite(sum)) {
    std::fill(particles.weight.begin(), particles.weight.end(), 1.0 / static_cast<double>(particles.size()));
    return false;
  }
  for (double& w : particles.weight) w /= sum;
  return true;
}

void weigh_by_cost(ParticleSet& particles, const std::vector<float>& cost, double temperature) {
  if (particles.size() == 0) return;
  const double best = *std::min_element(cost.begin(), cost.end());
  for (std::size_t i = 0; i < particles.size(); ++i) {
    particles.weight[i] *= std::exp((best - cost[i]) / temperature);
  }
  normalize_weights(particles);
}

double effective_sample_size(const ParticleSet& particles) {
  double sum = 0.0, sum_of_squares = 0.0;
  for (const double w : particles.weight) {
    sum += w;
    sum_of_squares += w * w;
  }
  return sum_of_squares > 0.0 ? sum * sum / sum_of_squares : 0.0;
}

PoseEstimate weighted_mean(const ParticleSet& particles) {
  PoseEstimate estimate;
  static thread_local std::vector<double> cosine, sine;
  cosine.resize(particles.size());
  sine.resize(particles.size());
  cos_sin(particles.yaw_rad.data(), particles.size(), cosine.data(), sine.data());
  double sum = 0.0, x = 0.0, y = 0.0, c = 0.0, s = 0.0;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const double w = particles.weight[i];
    sum += w;
    x += w * particles.x_m[i];
    y += w * particles.y_m[i];
    c += w * cosine[i];
    s += w * sine[i];
  }
  if (!(sum > 0.0)) return estimate;
  estimate.mean = {x / sum, y / sum, std::atan2(s, c)};
  double xx = 0.0, xy = 0.0, xt = 0.0, yy = 0.0, yt = 0.0, tt = 0.0;
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const double w = particles.weight[i];
    const double dx = particles.x_m[i] - estimate.mean.x_m, dy = particles.y_m[i] - estimate.mean.y_m;
    const double turn = particles.yaw_rad[i] - estimate.mean.yaw_rad;
    const double dt = turn - 2.0 * kPi * rounded(turn / (2.0 * kPi));
    xx += w * dx * dx;
    xy += w * dx * dy;
    xt += w * dx * dt;
    yy += w * dy * dy;
    yt += w * dy * dt;
    tt += w * dt * dt;
  }
  estimate.covariance << xx, xy, xt, xy, yy, yt, xt, yt, tt;
  estimate.covariance /= sum;
  return estimate;
}

void resample_low_variance(ParticleSet& particles, std::size_t count, double u, std::vector<std::uint32_t>* parent) {
  if (particles.size() == 0 || count == 0) return;
  static thread_local std::vector<std::uint32_t> scratch;
  std::vector<std::uint32_t>& from = parent ? *parent : scratch;
  from.resize(count);
  double total = 0.0;
  for (const double w : particles.weight) total += w;
  const double step = total / static_cast<double>(count);
  double cumulative = particles.weight[0];
  std::size_t i = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double target = (static_cast<double>(k) + u) * step;
    while (cumulative <= target && i + 1 < particles.size()) cumulative += particles.weight[++i];
    from[k] = static_cast<std::uint32_t>(i);
  }
  static thread_local std::vector<double> old;
  for (std::vector<double>* field : {&particles.x_m, &particles.y_m, &particles.yaw_rad}) {
    old.assign(field->begin(), field->end());
    field->resize(count);
    for (std::size_t k = 0; k < count; ++k) (*field)[k] = old[from[k]];
  }
  particles.weight.assign(count, 1.0 / static_cast<double>(count));
}

}  // namespace knav
