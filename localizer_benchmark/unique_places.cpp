#include "localizer_benchmark/unique_places.h"

#include <algorithm>
#include <cmath>

namespace knav {
namespace {

constexpr double kStep_m = 0.2;
constexpr int kHeadings = 72;
constexpr double kClear_m = 0.15;
constexpr double kNear_m = 0.4, kNearer_m = 0.2;  // while trying places, and after refinement
constexpr double kCoarseShare = 0.75, kFits = 0.9;
constexpr std::size_t kPoints = 120;
constexpr double kHalfView_rad = 0.5 * 57.0 * kPi / 180.0, kView_m = 8.0;
constexpr double kElsewhere_m = 0.75, kElsewhere_rad = 0.4;
constexpr std::size_t kRaysApart = 20;  // of the perfect scan's 3,600: 2 deg

PriceField within(const DistanceMap& map, double distance_m) {
  std::vector<std::uint8_t> prices;
  for (const float d : map.distance_m) prices.push_back(std::fabs(d) <= distance_m ? 0 : 255);  // 255 for NaN
  return {map.geometry, prices, 255};
}

WeightedPoints thinned(const std::vector<Point2>& view) {
  WeightedPoints points;
  const std::size_t stride = std::max<std::size_t>(1, (view.size() + kPoints - 1) / kPoints);
  for (std::size_t i = 0; i < view.size(); i += stride) {
    points.add(static_cast<float>(view[i].x_m), static_cast<float>(view[i].y_m), 1.0f);
  }
  return points;
}

bool elsewhere(const Pose2& a, const Pose2& b) {
  return distance_m(a, b) > kElsewhere_m || std::fabs(normalize_angle_rad(a.yaw_rad - b.yaw_rad)) > kElsewhere_rad;
}

}  // namespace

std::vector<Point2> true_view(const ProfileRecording& drive, std::size_t frame, double seconds) {
  std::vector<Point2> view;
  RangeScan scan;
  Pose2 T_world_view, T_world_base;
  const double from_s = drive.stamp_s(frame);
  if (!interpolate_at(drive.truth, from_s, 1.0, &T_world_view)) return view;
  for (const ProfileRecording::PerfectScan& perfect : drive.perfect_scans) {
    const double stamp_s = drive.stamp_s(perfect.frame);
    if (perfect.frame < frame || stamp_s > from_s + seconds) continue;
    if (!interpolate_at(drive.truth, stamp_s, 1.0, &T_world_base)) continue;
    const Pose2 T_view_base = T_world_view.inverse() * T_world_base;
    ProfileRecording::perfect_scan(perfect, &scan);
    for (std::size_t i = 0; i < scan.range_m.size(); i += kRaysApart) {
      const double angle = scan.angle_min_rad + scan.angle_increment_rad * static_cast<double>(i), range = scan.range_m[i];
      if (!(range < kView_m) || std::fabs(normalize_angle_rad(angle)) > kHalfView_rad) continue;
      view.push_back(T_view_base * Point2{range * std::cos(angle), range * std::sin(angle)});
    }
  }
  return view;
}

UniquePlaces::UniquePlaces(const DistanceMap& map) : near_(within(map, kNear_m)), nearer_(within(map, kNearer_m)) {
  const GridGeometry& g = map.geometry;
  for (double y = g.origin_y_m; y < g.origin_y_m + g.height_cells * g.resolution_m; y += kStep_m) {
    for (double x = g.origin_x_m; x < g.origin_x_m + g.width_cells * g.resolution_m; x += kStep_m) {
      if (map.nearest(x, y) > kClear_m) positions_.push_back({x, y});
    }
  }
}

double UniquePlaces::fit(const std::vector<Point2>& view, const Pose2& T_map_view) const {
  ParticleSet one;
  one.resize(1);
  one.set(0, T_map_view);
  std::vector<float> miss;
  mean_prices(nearer_, thinned(view), one, &miss);
  return 1.0 - miss[0];
}

double UniquePlaces::refined_fit(const WeightedPoints& points, Pose2* pose) const {
  ParticleSet around;
  std::vector<float> miss;
  float best = 1.0f;
  for (const double step_m : {0.1, 0.05, 0.025}) {
    for (int round = 0; round < 2; ++round) {
      around.resize(27);
      std::size_t k = 0;
      for (const int dx : {0, -1, 1}) {
        for (const int dy : {0, -1, 1}) {
          for (const int dyaw : {0, -1, 1}) {
            around.set(k++, {pose->x_m + dx * step_m, pose->y_m + dy * step_m, pose->yaw_rad + dyaw * 0.22 * step_m});
          }
        }
      }
      mean_prices(nearer_, points, around, &miss);
      const auto winner = std::min_element(miss.begin(), miss.end()) - miss.begin();
      best = miss[static_cast<std::size_t>(winner)];
      if (winner == 0) break;
      *pose = around.pose(static_cast<std::size_t>(winner));
    }
  }
  return 1.0 - best;
}

bool UniquePlaces::unique(const std::vector<Point2>& view, const Pose2& T_map_view, Pose2* other) const {
  const WeightedPoints points = thinned(view);
  ParticleSet poses;
  poses.resize(kHeadings);
  std::vector<float> miss;
  struct Candidate {
    float miss;
    Pose2 pose;
  };
  std::vector<Candidate> candidates;
  for (const Point2& p : positions_) {
    for (int h = 0; h < kHeadings; ++h) poses.set(static_cast<std::size_t>(h), {p.x_m, p.y_m, normalize_angle_rad(2.0 * kPi * h / kHeadings)});
    mean_prices(near_, points, poses, &miss);
    for (int h = 0; h < kHeadings; ++h) {
      const auto k = static_cast<std::size_t>(h);
      if (1.0 - miss[k] >= kCoarseShare && elsewhere(poses.pose(k), T_map_view)) candidates.push_back({miss[k], poses.pose(k)});
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) { return a.miss < b.miss; });
  for (Candidate& c : candidates) {
    if (refined_fit(points, &c.pose) >= kFits && elsewhere(c.pose, T_map_view)) {
      *other = c.pose;
      return false;
    }
  }
  return true;
}

}  // namespace knav
