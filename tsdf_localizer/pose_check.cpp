#include "tsdf_localizer/pose_check.h"

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

/// The camera's view just now, and no more: what was seen a few seconds ago is the old place's after a kidnap.
constexpr float kFreshEvidence = 0.97f;
constexpr std::uint32_t kFreshRaysMin = 30;

/// True if the segment from the sensor meets a surface more than `slack_m` before its end. Sphere tracing:
/// the map's own value says how far no surface can be. Ends at the first unknown cell, of which nothing can
/// be said.
///
/// What it meets nearer than `body_m` cannot be there, as the robot is: that has been taken away, with what the map could not see of it,
/// up to `taken_away_m` from the robot. That is one thing that has changed, not one per ray, and what lies behind it tells all the same.
bool meets_wall(const DistanceMap& map, const Point2& from, const Point2& to, double length_m,
                double slack_m, double body_m, double taken_away_m) {
  const GridGeometry& grid = map.geometry;
  const double step_min_m = 0.5 * grid.resolution_m;
  const double ux = (to.x_m - from.x_m) / length_m, uy = (to.y_m - from.y_m) / length_m;
  const double end_m = length_m - slack_m;
  bool in_the_open = !(body_m > 0.0);
  double s = 0.0;
  while (s < end_m) {
    const double distance_m = map.nearest(from.x_m + s * ux, from.y_m + s * uy);
    const bool open = distance_m >= 0.0;  // false for NaN
    const double clear_m = open ? std::max(0.0, distance_m - grid.resolution_m) : 0.0;  // less a cell, as the value is the nearest cell centre's
    in_the_open = in_the_open || (open && s + clear_m >= body_m) || s >= taken_away_m;
    if (in_the_open && !open) return distance_m < 0.0;
    s += std::max(step_min_m, clear_m);
  }
  return false;
}

}  // namespace

double support_of(double explained, double in_front, double through) {
  const double judged = explained + in_front + through;
  return judged > 0.0 ? (explained + 0.5 * in_front) / judged : 1.0;
}

PoseCheck check_pose(const DistanceMap& map, const ScanRays& rays, const Pose2& T_map_base,
                     const MeasurementConfig& measurement, const HealthConfig& health, bool stands_there) {
  PoseCheck check;
  const Pose2 T_map_sensor = T_map_base * rays.T_base_sensor;
  const Point2 from{T_map_sensor.x_m, T_map_sensor.y_m};
  const double c = std::cos(T_map_base.yaw_rad), s = std::sin(T_map_base.yaw_rad);
  enum Kind { kExplained, kInFront, kThrough, kUnknown };
  double all[4] = {}, fresh[4] = {};  // what the rays of each kind count
  std::uint32_t fresh_rays = 0;
  double cost = 0.0, weight = 0.0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const double px = rays.points.x_m[i], py = rays.points.y_m[i], range_m = rays.range_m[i];
    const Point2 to{T_map_base.x_m + c * px - s * py, T_map_base.y_m + s * px + c * py};
    const double distance_m = std::fabs(map.nearest(to.x_m, to.y_m));
    const double near_m = health.explained_m + health.explained_per_range * range_m;
    // a glancing ray meets a wall long before its end though the pose is only a little off: hence slack with
    // range
    const bool through = meets_wall(map, from, to, range_m, 2.0 * health.explained_m + 0.1 * range_m,
                                    stands_there ? health.body_radius_m : 0.0, health.taken_away_m);
    double price = measurement.unknown_cost;
    Kind kind = kUnknown;
    if (through && distance_m <= near_m) {
      // It ends on a wall of the map behind something that the map has as well: that was taken away. A wrong pose would need
      // luck for this. As good a sign as something that stands before a wall.
      price = 0.5;
      kind = kInFront;
      ++check.in_front;
    } else if (through) {
      price = 1.0;
      kind = kThrough;
      ++check.through;
    } else if (!std::isfinite(distance_m)) {
      ++check.unknown;
    } else {
      price = std::min(1.0, distance_m / measurement.truncation_m);
      const bool explained = distance_m <= near_m;
      kind = explained ? kExplained : kInFront;
      (explained ? check.explained : check.in_front) += 1;
    }
    const double counts = range_m < health.full_range_m ? range_m / health.full_range_m : 1.0;
    all[kind] += counts;
    if (rays.evidence[i] >= kFreshEvidence && kind != kUnknown) {
      fresh[kind] += counts;
      ++fresh_rays;
    }
    cost += counts * rays.points.weight[i] * price;
    weight += counts * rays.points.weight[i];
  }
  if (weight > 0.0) check.cost = cost / weight;
  check.support = support_of(all[kExplained], all[kInFront], all[kThrough]);
  if (fresh_rays >= kFreshRaysMin) check.fresh_support = support_of(fresh[kExplained], fresh[kInFront], fresh[kThrough]);
  return check;
}

}  // namespace knav
