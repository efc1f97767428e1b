#include "synthetic_building.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/random.h"

namespace knav::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

/// Entry distance of the ray into the block by the slab method; Inf if it misses, 0 from inside.
double enter(const Block& b, const Point2& from, double dx, double dy) {
  double near = 0.0, far = kInf;
  const double origin[2] = {from.x_m, from.y_m}, direction[2] = {dx, dy};
  const double low[2] = {b.x0_m, b.y0_m}, high[2] = {b.x1_m, b.y1_m};
  for (int axis = 0; axis < 2; ++axis) {
    if (direction[axis] == 0.0) {
      if (origin[axis] < low[axis] || origin[axis] > high[axis]) return kInf;
      continue;
    }
    const double t0 = (low[axis] - origin[axis]) / direction[axis],
                 t1 = (high[axis] - origin[axis]) / direction[axis];
    near = std::max(near, std::min(t0, t1));
    far = std::min(far, std::max(t0, t1));
  }
  return near <= far ? near : kInf;
}

double signed_distance_to(const Block& b, const Point2& p) {
  const double dx = std::max(b.x0_m - p.x_m, p.x_m - b.x1_m), dy = std::max(b.y0_m - p.y_m, p.y_m - b.y1_m);
  if (dx <= 0.0 && dy <= 0.0) return std::max(dx, dy);
  return std::hypot(std::max(dx, 0.0), std::max(dy, 0.0));
}

}  // namespace

double Building::range(const Point2& from, double angle_rad, double range_max_m) const {
  const double dx = std::cos(angle_rad), dy = std::sin(angle_rad);
  double nearest = kInf;
  for (const Block& b : blocks) nearest = std::min(nearest, enter(b, from, dx, dy));
  return nearest <= range_max_m ? nearest : kInf;
}

double Building::signed_distance(const Point2& p) const {
  double nearest = kInf;
  for (const Block& b : blocks) nearest = std::min(nearest, signed_distance_to(b, p));
  return nearest;
}

DistanceMap Building::distance_map(double resolution_m) const {
  DistanceMap map;
  map.geometry.resolution_m = resolution_m;
  map.geometry.origin_x_m = map.geometry.origin_y_m = -1.0;
  map.geometry.width_cells = static_cast<int>(std::lround((width_m + 2.0) / resolution_m));
  map.geometry.height_cells = static_cast<int>(std::lround((height_m + 2.0) / resolution_m));
  map.distance_m.resize(map.geometry.cell_count());
  for (int iy = 0; iy < map.geometry.height_cells; ++iy) {
    for (int ix = 0; ix < map.geometry.width_cells; ++ix) {
      const Point2 p{map.geometry.center_x_m(ix), map.geometry.center_y_m(iy)};
      const double d = signed_distance(p);
      const bool outside = p.x_m < 0.0 || p.y_m < 0.0 || p.x_m > width_m || p.y_m > height_m;
      map.distance_m[map.geometry.index(ix, iy)] = static_cast<float>(outside && d > 0.0 ? NAN : d);
    }
  }
  return map;
}

Building office() {
  Building b;
  b.width_m = 24.0;
  b.height_m = 16.0;
  b.wall(0.0, 0.0, 24.0, 0.15);
  b.wall(0.0, 15.85, 24.0, 16.0);
  b.wall(0.0, 0.0, 0.15, 16.0);
  b.wall(23.85, 0.0, 24.0, 16.0);
  // corridor from y = 7 to y = 9; doors 1 m wide
  for (const auto& [from, to] : std::vector<std::pair<double, double>>{{0, 3}, {4, 10}, {11, 19}, {20, 24}}) {
    b.wall(from, 6.9, to, 7.0);
  }
  for (const auto& [from, to] :
       std::vector<std::pair<double, double>>{{0, 5.5}, {6.5, 13}, {14, 17}, {18, 24}}) {
    b.wall(from, 9.0, to, 9.1);
  }
  b.wall(7.0, 0.0, 7.1, 7.0);
  b.wall(16.0, 0.0, 16.1, 7.0);
  b.wall(9.0, 9.1, 9.1, 16.0);
  b.wall(15.5, 9.1, 15.6, 16.0);
  // furniture
  b.wall(1.0, 1.0, 2.6, 1.8);
  b.wall(5.4, 3.0, 6.2, 4.6);
  b.wall(0.15, 4.5, 0.6, 6.0);
  b.wall(9.0, 2.0, 11.4, 3.0);
  b.wall(13.5, 4.5, 15.0, 5.3);
  b.wall(12.0, 0.15, 14.0, 0.6);
  b.wall(18.0, 2.5, 19.2, 3.7);
  b.wall(21.5, 0.15, 23.85, 1.0);
  b.wall(22.9, 4.0, 23.85, 5.5);
  b.wall(2.0, 11.5, 4.0, 12.5);
  b.wall(7.5, 13.0, 8.3, 15.85);
  b.wall(10.5, 13.8, 12.0, 15.0);
  b.wall(12.8, 11.0, 13.6, 11.8);
  b.wall(17.5, 12.0, 20.0, 13.0);
  b.wall(21.8, 14.5, 23.0, 15.3);
  b.wall(22.8, 10.0, 23.6, 11.5);
  return b;
}

Building twin_rooms() {
  Building b;
  b.width_m = 12.2;
  b.height_m = 9.0;
  for (const double x : {0.0, 6.0}) {  // each room 6 x 6 m with the same table and door, above the lane
    b.wall(x, 3.0, x + 0.2, 9.0);
    b.wall(x, 8.8, x + 6.2, 9.0);
    b.wall(x, 3.0, x + 2.5, 3.2);
    b.wall(x + 3.5, 3.0, x + 6.2, 3.2);
    b.wall(x + 3.8, 6.0, x + 5.2, 7.2);
    b.wall(x + 0.2, 7.5, x + 1.0, 8.8);
  }
  b.wall(12.0, 3.0, 12.2, 9.0);
  b.wall(0.0, 0.0, 12.2, 0.2);
  b.wall(0.0, 0.0, 0.2, 3.0);
  b.wall(12.0, 0.0, 12.2, 3.0);
  b.wall(0.2, 0.2, 1.8, 1.4);  // in the lane only: tells left from right
  return b;
}

RangeScan make_scan(const Building& building, const Pose2& T_map_base, const ScanModel& model, double stamp_s,
                    std::uint64_t seed) {
  RangeScan scan;
  scan.stamp_s = stamp_s;
  scan.angle_min_rad = -kPi;
  scan.angle_increment_rad = 2.0 * kPi / model.rays;
  scan.range_min_m = 0.1;
  scan.range_max_m = model.range_max_m;
  const auto count = static_cast<std::size_t>(model.rays);
  scan.range_m.resize(count);
  scan.evidence.resize(count);
  const auto step = static_cast<std::uint64_t>(std::llround(stamp_s * 1000.0));
  for (std::size_t i = 0; i < count; ++i) {
    RandomStream random(seed, random_stream::kTest, step, static_cast<std::uint32_t>(i));
    RandomStream patch(seed, random_stream::kTest + 1, step / 1000, static_cast<std::uint32_t>(i / 20));
    const double angle = scan.angle_min_rad + scan.angle_increment_rad * static_cast<double>(i);
    double r =
        building.range({T_map_base.x_m, T_map_base.y_m}, T_map_base.yaw_rad + angle, model.range_max_m);
    if (std::isfinite(r)) r += (model.noise_m + model.noise_per_range_squared * r * r) * random.normal();
    const bool fresh = std::fabs(angle) <= model.fresh_fov_rad / 2.0;
    const bool unknown = !fresh && patch.uniform() < model.unknown_fraction;
    scan.range_m[i] = static_cast<float>(unknown ? NAN : r);
    scan.evidence[i] = static_cast<float>(unknown ? 0.0 : fresh ? 1.0 : model.old_evidence);
  }
  return scan;
}

RangeScan RememberedView::scan(const Pose2& T_map_base, const Pose2& T_odom_base, double stamp_s) {
  seen_.push_back({T_map_base, T_odom_base, stamp_s});
  RangeScan scan = make_scan(building_, T_map_base, model_, stamp_s);
  ScanModel exact = model_;
  exact.noise_m = exact.noise_per_range_squared = 0.0;
  const RangeScan now = make_scan(building_, T_map_base, exact, stamp_s);  // the same patches are unknown
  for (std::size_t i = 0; i < now.range_m.size(); ++i) {
    const double angle = now.angle_min_rad + now.angle_increment_rad * static_cast<double>(i);
    if (std::fabs(angle) <= model_.fresh_fov_rad / 2.0) continue;
    scan.range_m[i] = NAN;
    scan.evidence[i] = 0.0f;
  }
  for (std::size_t i = 0; i < now.range_m.size(); ++i) {
    const double angle = now.angle_min_rad + now.angle_increment_rad * static_cast<double>(i), range_m = now.range_m[i];
    if (std::fabs(angle) <= model_.fresh_fov_rad / 2.0 || !std::isfinite(range_m)) continue;
    const Point2 point = T_map_base * Point2{range_m * std::cos(angle), range_m * std::sin(angle)};
    for (auto seen = seen_.rbegin(); seen != seen_.rend(); ++seen) {
      const Point2 there = seen->T_map_base.inverse() * point;
      if (std::fabs(std::atan2(there.y_m, there.x_m)) > model_.fresh_fov_rad / 2.0 || std::hypot(there.x_m, there.y_m) > model_.range_max_m) continue;
      const Point2 here = T_odom_base.inverse() * (seen->T_odom_base * there);
      const double bearing = std::atan2(here.y_m, here.x_m);
      if (std::fabs(bearing) <= model_.fresh_fov_rad / 2.0) break;
      const auto k = static_cast<std::size_t>(std::lround((bearing - scan.angle_min_rad) / scan.angle_increment_rad)) % scan.range_m.size();
      scan.range_m[k] = static_cast<float>(std::hypot(here.x_m, here.y_m));
      scan.evidence[k] = static_cast<float>(std::exp((seen->stamp_s - stamp_s) / model_.evidence_decay_s));
      break;
    }
  }
  return scan;
}

std::vector<Pose2> drive(const std::vector<Point2>& points, double rate_hz) {
  std::vector<Pose2> poses;
  double yaw = std::atan2(points[1].y_m - points[0].y_m, points[1].x_m - points[0].x_m);
  for (std::size_t k = 0; k + 1 < points.size(); ++k) {
    const double dx = points[k + 1].x_m - points[k].x_m, dy = points[k + 1].y_m - points[k].y_m;
    const double turn = normalize_angle_rad(std::atan2(dy, dx) - yaw), length = std::hypot(dx, dy);
    const int turn_steps = static_cast<int>(std::ceil(std::fabs(turn) * rate_hz / 1.0));
    for (int i = 0; i < turn_steps; ++i)
      poses.push_back({points[k].x_m, points[k].y_m, yaw + turn * i / turn_steps});
    yaw = normalize_angle_rad(yaw + turn);
    const int steps = static_cast<int>(std::ceil(length * rate_hz / 0.5));
    for (int i = 0; i < steps; ++i) {
      poses.push_back({points[k].x_m + dx * i / steps, points[k].y_m + dy * i / steps, yaw});
    }
  }
  poses.push_back({points.back().x_m, points.back().y_m, yaw});
  return poses;
}

std::vector<Pose2> odometry_of(const std::vector<Pose2>& truth, double length_factor, double angle_factor) {
  std::vector<Pose2> odometry(truth.size());
  for (std::size_t i = 1; i < truth.size(); ++i) {
    const Pose2 step = truth[i - 1].inverse() * truth[i];
    odometry[i] = odometry[i - 1] *
                  Pose2{step.x_m * length_factor, step.y_m * length_factor, step.yaw_rad * angle_factor};
  }
  return odometry;
}

}  // namespace knav::test
