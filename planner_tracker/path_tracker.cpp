#include "planner_tracker/path_tracker.h"

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

constexpr double kStep_m = 0.04;
constexpr double kNearEnd_m = 0.4;
constexpr double kPast_m = 0.4;        ///< straight on, to be past what stands right beside the robot
constexpr double kPastStep_rad = 0.1;
constexpr double kAlong = 0.3;         ///< of turned_rad, where the turn is for looking along the way
constexpr double kWalkerAhead_s = 2.0, kWalkerStep_s = 0.2;
constexpr double kHelps_m = 0.05;
constexpr double kPassed_m = 0.12;     ///< before the end of that
constexpr double kTurned_rad = 0.03;

}  // namespace

PathTracker::PathTracker(const PlannerTrackerConfig& config)
    : config_(config),
      outline_(config.outline()),
      margin_m_(config.clearance.insist * config.clearance.hard_m),
      stop_radius_m_(outline_.inscribed_m() + margin_m_),
      hard_radius_m_(outline_.inscribed_m() + config.clearance.hard_m),
      preferred_radius_m_(outline_.inscribed_m() + config.clearance.preferred_m) {}

void PathTracker::reset() { turning_ = passing_ = false; }

double PathTracker::approach(double from, double to, double step) const {
  return to > from ? std::min(to, from + step) : std::max(to, from - step);
}

TrackOutput PathTracker::stop(const TrackInput& input) const {
  TrackOutput out;
  out.v_mps = approach(input.v_mps, 0.0, config_.tracking.stop_decel_mps2 * input.dt_s);
  out.w_radps = approach(input.w_radps, 0.0, config_.acc_lim_theta * input.dt_s);
  return out;
}

TrackOutput PathTracker::turn(const TrackInput& input, double error_rad) const {
  TrackOutput out;
  out.kind = TrackOutput::Kind::kTurning;
  out.v_mps = approach(input.v_mps, 0.0, config_.tracking.stop_decel_mps2 * input.dt_s);
  // Braking at 60 % of what the wheels can do ends the turn without overshoot.
  double w =
      std::min(config_.max_vel_theta, std::sqrt(2.0 * 0.6 * config_.acc_lim_theta * std::abs(error_rad)));
  w = std::max(w * std::min(1.0, std::abs(error_rad) / 0.1), config_.tracking.min_in_place_vel_theta);
  if (std::abs(error_rad) < 0.01) w = 0.0;
  if (w > 0.0 && !outline_.is_disc()) {
    // A corner may be in the way; then the other way round.
    const double side = std::copysign(1.0, error_rad), most = std::abs(error_rad);
    if (turn_free_rad(input, side, most) < most - 1e-6) {
      if (turn_free_rad(input, -side, 2.0 * kPi - most) > 2.0 * kPi - most - 1e-6) {
        error_rad = -error_rad;
      } else {
        w = 0.0;
        out.kind = TrackOutput::Kind::kBlocked;
        out.obstacle = {input.T_map_base.x_m, input.T_map_base.y_m};
      }
    }
  }
  out.w_radps = approach(input.w_radps, std::copysign(w, error_rad), config_.acc_lim_theta * input.dt_s);
  return out;
}

TrackOutput PathTracker::creep(const TrackInput& input, double distance_m) const {
  const bool backwards = distance_m < 0.0;
  const double top = backwards ? -config_.min_vel_x : config_.tracking.slow_mps;
  const Rollout ahead = roll_out(input, 0.0, std::min(std::abs(distance_m), 0.5), 0.5, backwards);
  TrackOutput out = stop(input);
  if (ahead.free_m < std::min(std::abs(distance_m), 0.06)) {
    out.kind = TrackOutput::Kind::kBlocked;
    out.obstacle = input.T_map_base * Point2{ahead.end_x_m, ahead.end_y_m};
    return out;
  }
  const double v = std::min({top, std::sqrt(2.0 * 0.7 * config_.acc_lim_x * std::abs(distance_m)),
                             std::sqrt(2.0 * config_.acc_lim_x * ahead.free_m)});
  out.v_mps = approach(input.v_mps, std::copysign(v, distance_m), config_.acc_lim_x * input.dt_s);
  return out;
}

double PathTracker::speed_near_moving_mps(const TrackInput& input, const Rollout& ahead) const {
  const TrackingConfig& t = config_.tracking;
  if (input.moving == nullptr || input.moving->empty()) return config_.max_vel_x;
  const Pose2 T_base_map = input.T_map_base.inverse();
  const double length2 = ahead.end_x_m * ahead.end_x_m + ahead.end_y_m * ahead.end_y_m;
  double nearest = t.moving_distance_m;
  for (const Point2& at : *input.moving) {
    const Point2 p = T_base_map * at;
    // Whoever is behind is left behind.
    if (p.x_m < 0.0) continue;
    const double along = length2 > 0.0 ? std::clamp((p.x_m * ahead.end_x_m + p.y_m * ahead.end_y_m) / length2, 0.0, 1.0) : 0.0;
    nearest = std::min(nearest, std::hypot(p.x_m - along * ahead.end_x_m, p.y_m - along * ahead.end_y_m) - hard_radius_m_);
  }
  const double share = std::clamp(nearest / t.moving_distance_m, 0.0, 1.0);
  const double slow = std::min(t.moving_mps, config_.max_vel_x);
  return slow + (config_.max_vel_x - slow) * share;
}

bool PathTracker::meets_a_walker(const TrackInput& input, double curvature, double v_mps, double reach_m) const {
  const TrackingConfig& t = config_.tracking;
  if (input.walkers == nullptr || t.walker_gap_m <= 0.0) return false;
  const Pose2 T_base_map = input.T_map_base.inverse();
  const double c = std::cos(T_base_map.yaw_rad), s = std::sin(T_base_map.yaw_rad);
  const double touch_m = outline_.circumscribed_m() + kBody_m, wanted_m = touch_m + t.walker_gap_m;
  for (const Walker& walker : *input.walkers) {
    const Point2 p = T_base_map * walker.at, step{c * walker.v_mps.x_m - s * walker.v_mps.y_m, s * walker.v_mps.x_m + c * walker.v_mps.y_m};
    const double now_m = std::hypot(p.x_m, p.y_m);
    double standing_m = now_m;  // how near he would come if the robot stood
    // Whom the camera sees is in the scan.
    if (in_view(input.T_map_base, walker.at)) continue;
    for (double ahead_s = kWalkerStep_s; ahead_s <= kWalkerAhead_s; ahead_s += kWalkerStep_s) {
      const double driven = std::min(v_mps * ahead_s, reach_m), turned = curvature * driven;
      const double x = std::abs(turned) < 1e-3 ? driven : std::sin(turned) / curvature;
      const double y = std::abs(turned) < 1e-3 ? 0.0 : (1.0 - std::cos(turned)) / curvature;
      const Point2 then{p.x_m + step.x_m * ahead_s, p.y_m + step.y_m * ahead_s};
      standing_m = std::min(standing_m, std::hypot(then.x_m, then.y_m));
      const double apart_m = std::hypot(then.x_m - x, then.y_m - y);
      // Standing must help: who walks up to the robot, or has passed it, is no reason to stand.
      if (standing_m < touch_m) break;
      if (apart_m < wanted_m && apart_m < now_m && apart_m < standing_m - kHelps_m) return true;
    }
  }
  return false;
}

double PathTracker::bearing_past(const TrackInput& input, double bearing_rad) const {
  // Not so far off the path that the robot would turn back to it first.
  const double most = 0.85 * config_.tracking.turn_first_rad;
  for (double off = kPastStep_rad; off < most; off += kPastStep_rad) {
    for (const double side : {-1.0, 1.0}) {
      const double past = bearing_rad + side * off;
      if (straight_free_m(input, past, kPast_m) >= kPast_m) return past;
    }
  }
  return 0.0;
}

bool PathTracker::still_passes(const TrackInput& input) const {
  const Point2 p = input.T_map_base.inverse() * past_;
  const double distance = std::hypot(p.x_m, p.y_m);
  return p.x_m > kPassed_m && straight_free_m(input, std::atan2(p.y_m, p.x_m), distance) > distance - 2.0 * kStep_m;
}

TrackOutput PathTracker::follow(const TrackInput& input, const Path& path) {
  const TrackingConfig& t = config_.tracking;
  const double share = std::clamp(input.v_mps / config_.max_vel_x, 0.0, 1.0);
  const Pose2 T_base_map = input.T_map_base.inverse();
  passing_ = passing_ && still_passes(input);
  double lookahead = t.lookahead_m * (0.6 + 0.4 * share) + path.offset_m();
  // Not across a corner: the straight line to the point must be as open as the robot's own place allows.
  const double here = point_clearance_m(input, 0.0, 0.0);
  const double wanted = std::min({hard_radius_m_ - 0.02, here - 0.005});
  Point2 target = T_base_map * past_;
  for (; !passing_; lookahead *= 0.75) {
    target = T_base_map * path.point_at(path.at_m() + lookahead);
    const double length = std::hypot(target.x_m, target.y_m);
    bool open = true;
    for (double s = kStep_m; s < length && open; s += kStep_m) {
      open = point_clearance_m(input, target.x_m * s / length, target.y_m * s / length) >= wanted;
    }
    if (open || lookahead < 0.2) break;
  }
  const double distance = std::hypot(target.x_m, target.y_m);
  const double bearing = std::atan2(target.y_m, target.x_m);

  const bool near_end = path.remaining_m() < kNearEnd_m;
  const bool unseen = (turning_ || (std::abs(bearing) > t.unseen_turn_first_rad && std::abs(bearing) <= t.turn_first_rad)) && sweeps_unseen(input, target);
  const double turn_first = unseen ? t.unseen_turn_first_rad : passing_ ? kPastStep_rad : near_end ? 0.6 * t.turn_first_rad : t.turn_first_rad;
  if (turning_ ? std::abs(bearing) > (unseen ? kAlong : 1.0) * t.turned_rad : std::abs(bearing) > turn_first) {
    turning_ = true;
    // Half a turn may go either way: keep to the one begun.
    const bool about_face = std::abs(bearing) > 2.8 && std::abs(input.w_radps) > 0.1;
    return turn(input, about_face ? std::copysign(bearing, input.w_radps) : bearing);
  }
  turning_ = false;

  double curvature = 2.0 * std::sin(bearing) / std::max(distance, 0.1);
  const double look = std::max(0.5, config_.max_vel_x * t.horizon_s);
  const double reach = std::min(look, passing_ ? distance : path.remaining_m() + path.offset_m() + 0.02);
  Rollout ahead = roll_out(input, curvature, reach, 0.6, false);
  const double enough = std::min(reach - 0.01, 0.35);
  if (ahead.free_m < enough && !passing_) {
    // Something the plan does not know yet. An arc beside the nominal one that stays near the path?
    double best = 1e9, best_curvature = curvature;
    Rollout best_rollout;
    for (int i = -8; i <= 8; ++i) {
      const double k = curvature + 0.4 * i;
      if (i == 0 || std::abs(k) > 3.5) continue;
      const Rollout r = roll_out(input, k, std::min(reach, 0.8), 0.6, false);
      if (r.free_m < enough) continue;
      const double off = std::hypot(r.end_x_m - target.x_m, r.end_y_m - target.y_m);
      const double cost =
          off + 0.05 * std::abs(i) + 0.5 * std::max(0.0, preferred_radius_m_ - r.least_clearance_m);
      if (cost < best && r.end_x_m > 0.1) {
        best = cost;
        best_curvature = k;
        best_rollout = r;
      }
    }
    if (best < 0.8) {
      curvature = best_curvature;
      ahead = best_rollout;
    }
  }
  if (ahead.free_m < std::min(0.06, reach - 0.01)) {
    passing_ = false;
    const double past = bearing_past(input, bearing);
    if (std::abs(past) > kTurned_rad) {
      past_ = input.T_map_base * Point2{kPast_m * std::cos(past), kPast_m * std::sin(past)};
      passing_ = turning_ = true;
      return turn(input, past);
    }
    TrackOutput out = std::abs(bearing) > t.turned_rad ? turn(input, bearing) : stop(input);
    out.v_mps = 0.0;
    out.kind = TrackOutput::Kind::kBlocked;
    out.obstacle = input.T_map_base * Point2{ahead.end_x_m, ahead.end_y_m};
    return out;
  }

  // Every limit has its own reason; the lowest holds.
  double v = std::min({ahead.speed_mps, config_.max_vel_x, speed_near_moving_mps(input, ahead)});
  v *= std::clamp(1.0 - 0.8 * (std::abs(bearing) - 0.2) / t.turn_first_rad, 0.15, 1.0);
  if (std::abs(curvature) > 1e-6) v = std::min(v, config_.max_vel_theta / std::abs(curvature));
  v = std::min(v, std::sqrt(2.0 * 0.7 * config_.acc_lim_x * std::max(0.0, path.remaining_m())) + 0.01);
  const double a = t.stop_decel_mps2, delay = t.reaction_s;
  bool brake = meets_a_walker(input, curvature, v, reach);
  if (brake) v = 0.0;
  if (ahead.free_m < reach - 0.01) {
    const double room = std::max(0.0, ahead.free_m - 0.05);
    const double v_stop = a * (std::sqrt(delay * delay + 2.0 * room / a) - delay);
    brake = brake || v_stop < v;
    v = std::min(v, v_stop);
  }
  TrackOutput out;
  const double down = (brake ? t.stop_decel_mps2 : config_.acc_lim_x) * input.dt_s;
  out.v_mps = v < input.v_mps ? std::max(v, input.v_mps - down)
                              : std::min(v, std::max(input.v_mps, 0.0) + config_.acc_lim_x * input.dt_s);
  out.w_radps = approach(input.w_radps,
                         std::clamp(out.v_mps * curvature, -config_.max_vel_theta, config_.max_vel_theta),
                         config_.acc_lim_theta * input.dt_s);
  return out;
}

}  // namespace knav
