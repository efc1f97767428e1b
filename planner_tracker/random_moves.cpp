#include "planner_tracker/random_moves.h"

#include <algorithm>
#include <cmath>

#include "core/random.h"

namespace knav {
namespace {

constexpr int kDirections = 24;
constexpr double kTurn_s = 6.0;  ///< the longest that a move's turn may take

}  // namespace

void RandomMoves::start(int count, const Stride& stride) {
  left_ = count;
  stride_ = stride;
  ++sequence_;
  move_ = 0;
  phase_ = Phase::kChoose;
}

void RandomMoves::next() {
  --left_;
  ++move_;
  phase_ = Phase::kChoose;
}

void RandomMoves::choose(const Pose2& T_odom_base, const FreeWay& free_way) {
  RandomStream random(static_cast<std::uint64_t>(config_.seed), random_stream::kRecovery, sequence_, move_);
  double bearing[kDirections], free[kDirections], sum = 0.0;
  for (int i = 0; i < kDirections; ++i) {
    bearing[i] = normalize_angle_rad(2.0 * kPi * (i + random.uniform()) / kDirections);
    const double way = free_way(bearing[i]);
    free[i] = way >= stride_.shortest_m + 0.05 ? std::min(way, stride_.open_enough_m) : 0.0;
    sum += free[i];
  }
  T_odom_start_ = T_odom_base;
  spent_s_ = 0.0;
  phase_ = Phase::kTurn;
  if (sum <= 0.0) {
    // Walled in: only a look elsewhere.
    heading_odom_rad_ = normalize_angle_rad(T_odom_base.yaw_rad + random.uniform(-kPi, kPi));
    distance_m_ = 0.0;
    return;
  }
  double draw = random.uniform(0.0, sum);
  int chosen = kDirections - 1;
  for (int i = 0; i < kDirections; ++i) {
    draw -= free[i];
    if (draw < 0.0 && free[i] > 0.0) {
      chosen = i;
      break;
    }
  }
  while (free[chosen] <= 0.0) --chosen;
  heading_odom_rad_ = normalize_angle_rad(T_odom_base.yaw_rad + bearing[chosen]);
  distance_m_ = std::min(random.uniform(stride_.shortest_m, stride_.longest_m), free[chosen] - 0.05);
}

TrackOutput RandomMoves::step(const TrackInput& input, const Pose2& T_odom_base, const FreeWay& free_way) {
  if (!active()) return tracker_->stop(input);
  if (phase_ == Phase::kChoose) choose(T_odom_base, free_way);
  spent_s_ += input.dt_s;
  if (spent_s_ > kTurn_s + 2.0 * stride_.longest_m / stride_.speed_mps) {
    next();
    return tracker_->stop(input);
  }
  const double error = normalize_angle_rad(heading_odom_rad_ - T_odom_base.yaw_rad);
  if (phase_ == Phase::kTurn) {
    if (std::abs(error) > config_.tracking.turned_rad) return tracker_->turn(input, error);
    phase_ = Phase::kGo;
  }
  const double left = distance_m_ - distance_m(T_odom_start_, T_odom_base);
  if (left < 0.02) {
    next();
    return tracker_->stop(input);
  }
  // Turned towards it, it may look different.
  if (free_way(0.0) < std::min(left, 0.08)) {
    next();
    return tracker_->stop(input);
  }
  TrackOutput out;
  const double v = std::min(stride_.speed_mps, std::sqrt(2.0 * 0.7 * config_.acc_lim_x * std::min(left, free_way(0.0))));
  out.v_mps = std::min(v, std::max(0.0, input.v_mps) + config_.acc_lim_x * input.dt_s);
  out.w_radps = std::clamp(1.5 * error, -0.4, 0.4);
  return out;
}

}  // namespace knav
