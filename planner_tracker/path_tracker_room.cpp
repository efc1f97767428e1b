// How much room PathTracker finds round the footprint, by scan and map together.
#include <algorithm>
#include <cmath>

#include "planner_tracker/path_tracker.h"

namespace knav {
namespace {

constexpr double kStep_m = 0.04;

}  // namespace

double PathTracker::point_clearance_m(const TrackInput& input, double x_m, double y_m) const {
  const double seen = input.scan->clearance_m(x_m, y_m);
  if (input.layer == nullptr) return seen;
  const Point2 p = input.T_map_base * Point2{x_m, y_m};
  return std::min(seen, input.layer->smooth_clearance_m(p.x_m, p.y_m));
}

double PathTracker::clearance_m(const TrackInput& input, double x_m, double y_m, double yaw_rad) const {
  double least = point_clearance_m(input, x_m, y_m);
  // A disc; or so much room that the polygon cannot touch, whichever way it faces.
  if (outline_.is_disc() || least >= outline_.circumscribed_m() + config_.clearance.preferred_m) return least;
  const double c = std::cos(yaw_rad), s = std::sin(yaw_rad);
  for (const Point2& p : outline_.outline()) {
    const double room = point_clearance_m(input, x_m + c * p.x_m - s * p.y_m, y_m + s * p.x_m + c * p.y_m);
    least = std::min(least, outline_.inscribed_m() + room);
  }
  return least;
}

double PathTracker::turn_free_rad(const TrackInput& input, double side, double most_rad) const {
  if (outline_.is_disc()) return most_rad;
  const double step = std::min(0.1, 0.04 / outline_.circumscribed_m());
  double demanded = std::min(stop_radius_m_, clearance_m(input, 0.0, 0.0, 0.0) - 0.005);
  double turned = 0.0;
  while (turned < most_rad) {
    const double c = clearance_m(input, 0.0, 0.0, side * (turned + step));
    if (c < demanded) break;
    demanded = std::min(stop_radius_m_, std::max(demanded, c - 0.03));
    turned += step;
  }
  return std::min(turned, most_rad);
}

bool PathTracker::unknown_ground(const TrackInput& input, double x_m, double y_m) const {
  if (std::hypot(x_m, y_m) <= 0.5 * outline_.inscribed_m()) return false;
  const Point2 p = input.T_map_base * Point2{x_m, y_m};
  return input.layer->clearance_m(p.x_m, p.y_m) <= 0.0;
}

bool PathTracker::sweeps_unseen(const TrackInput& input, const Point2& target) const {
  if (input.map == nullptr) return false;
  const double distance = std::hypot(target.x_m, target.y_m), bearing = std::atan2(target.y_m, target.x_m);
  const double curvature = 2.0 * std::sin(bearing) / std::max(distance, 0.1);
  double x = 0.0, y = 0.0, yaw = 0.0;
  for (double s = 0.0; s < distance; s += kStep_m) {
    x += kStep_m * std::cos(yaw);
    y += kStep_m * std::sin(yaw);
    yaw += kStep_m * curvature;
    for (const double side : {-stop_radius_m_, 0.0, stop_radius_m_}) {
      const Point2 p{x - side * std::sin(yaw), y + side * std::cos(yaw)};
      // Round the robot itself nobody has looked, where it was set down.
      if (std::hypot(p.x_m, p.y_m) > 1.2 * stop_radius_m_ && !input.map->seen(input.T_map_base * p)) return true;
    }
  }
  return false;
}

double PathTracker::speed_at_mps(double clearance_m) const {
  const double share = (clearance_m - hard_radius_m_) / std::max(0.01, preferred_radius_m_ - hard_radius_m_);
  return config_.tracking.slow_mps + (config_.max_vel_x - config_.tracking.slow_mps) * std::clamp(share, 0.0, 1.0);
}

double PathTracker::speed_before_mps(double distance_m, double then_mps) const {
  // distance = v delay + (v^2 - then^2) / (2 a), for v
  const double a = config_.acc_lim_x, late = a * config_.tracking.reaction_s;
  return std::max(then_mps, std::sqrt(late * late + then_mps * then_mps + 2.0 * a * distance_m) - late);
}

PathTracker::Rollout PathTracker::roll_out(const TrackInput& input, double curvature, double length_m,
                                           double near_m, bool backwards) const {
  Rollout out;
  const double here = clearance_m(input, 0.0, 0.0, 0.0);
  out.least_clearance_m = here;
  out.speed_mps = speed_at_mps(here);
  // Standing too near to something already, it may move, but not come nearer.
  double demanded = std::min(stop_radius_m_, here - 0.005);
  double yaw = 0.0;
  const double step = backwards ? -kStep_m : kStep_m;
  for (double s = 0.0; s < length_m; s += kStep_m) {
    const double middle = yaw + 0.5 * curvature * step;
    const double x = out.end_x_m + step * std::cos(middle), y = out.end_y_m + step * std::sin(middle);
    const double c = clearance_m(input, x, y, yaw + curvature * step);
    if (c < demanded || unknown_ground(input, x, y)) break;
    demanded = std::min(stop_radius_m_, std::max(demanded, c - 0.03));
    yaw += curvature * step;
    out.end_x_m = x;
    out.end_y_m = y;
    out.free_m = s + kStep_m;
    if (out.free_m <= near_m) out.least_clearance_m = std::min(out.least_clearance_m, c);
    out.speed_mps = std::min(out.speed_mps, speed_before_mps(out.free_m, speed_at_mps(c)));
  }
  return out;
}

double PathTracker::straight_free_m(const TrackInput& input, double bearing_rad, double length_m) const {
  double demanded = std::min(stop_radius_m_, clearance_m(input, 0.0, 0.0, bearing_rad) - 0.005);
  double s = 0.0;
  for (; s < length_m; s += kStep_m) {
    const double x = (s + kStep_m) * std::cos(bearing_rad), y = (s + kStep_m) * std::sin(bearing_rad);
    const double c = clearance_m(input, x, y, bearing_rad);
    if (c < demanded || unknown_ground(input, x, y)) break;
    demanded = std::min(stop_radius_m_, std::max(demanded, c - 0.03));
  }
  return std::min(s, length_m);
}

}  // namespace knav
