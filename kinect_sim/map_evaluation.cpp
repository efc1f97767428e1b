#include "kinect_sim/map_evaluation.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "core/error.h"
#include "kinect_sim/scene.h"
#include "kinect_sim/world_picture.h"

namespace knav {
namespace {

constexpr double kSample_m = 0.025;   ///< length that one sample of the true surface stands for
constexpr double kOffset_m = 0.0119;  ///< so that walls at round coordinates do not lie between two samples
constexpr double kOutlier_m = 0.3;

std::uint64_t cell_key(const Point2& p, double size_m) {
  const auto ix = static_cast<std::uint32_t>(static_cast<std::int32_t>(std::floor(p.x_m / size_m)));
  const auto iy = static_cast<std::uint32_t>(static_cast<std::int32_t>(std::floor(p.y_m / size_m)));
  return (std::uint64_t{ix} << 32) | iy;
}

/// Points to be asked for the nearest within a short distance.
class PointIndex {
 public:
  PointIndex(const std::vector<Point2>& points, double reach_m) : points_(points), reach_m_(reach_m) {
    for (std::size_t i = 0; i < points.size(); ++i) cells_[cell_key(points[i], reach_m)].push_back(i);
  }
  bool any_within_reach(const Point2& p) const {
    for (int dx = -1; dx <= 1; ++dx) {
      for (int dy = -1; dy <= 1; ++dy) {
        const auto cell = cells_.find(cell_key({p.x_m + dx * reach_m_, p.y_m + dy * reach_m_}, reach_m_));
        if (cell == cells_.end()) continue;
        for (const std::size_t i : cell->second) {
          if (std::hypot(points_[i].x_m - p.x_m, points_[i].y_m - p.y_m) <= reach_m_) return true;
        }
      }
    }
    return false;
  }

 private:
  const std::vector<Point2>& points_;
  double reach_m_;
  std::unordered_map<std::uint64_t, std::vector<std::size_t>> cells_;
};

/// One rigid alignment: point to nearest surface point, with fewer and fewer far pairs.
Pose2 align(const std::vector<Point2>& contour, const TrueSurfaces& surfaces, Pose2 T_world_map) {
  for (int round = 0; round < 40; ++round) {
    const double limit_m = round < 15 ? 1.0 : round < 25 ? 0.5 : 0.25;
    Eigen::Vector2d mean_map = Eigen::Vector2d::Zero(), mean_world = mean_map;
    std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> pairs;
    for (const Point2& p : contour) {
      Point2 hit;
      if (!surfaces.nearest(T_world_map * p, limit_m, &hit)) continue;
      pairs.emplace_back(Eigen::Vector2d(p.x_m, p.y_m), Eigen::Vector2d(hit.x_m, hit.y_m));
      mean_map += pairs.back().first;
      mean_world += pairs.back().second;
    }
    if (pairs.size() < 10) return T_world_map;
    mean_map /= static_cast<double>(pairs.size());
    mean_world /= static_cast<double>(pairs.size());
    double cosine = 0.0, sine = 0.0;
    for (const auto& [p, q] : pairs) {
      const Eigen::Vector2d a = p - mean_map, b = q - mean_world;
      cosine += a.dot(b);
      sine += a.x() * b.y() - a.y() * b.x();
    }
    const double yaw = std::atan2(sine, cosine), c = std::cos(yaw), s = std::sin(yaw);
    T_world_map = {mean_world.x() - c * mean_map.x() + s * mean_map.y(),
                   mean_world.y() - s * mean_map.x() - c * mean_map.y(), yaw};
  }
  return T_world_map;
}

/// What the sensor could see of the surfaces from the trajectory, as samples of equal length.
std::vector<Point2> visible_surface(const TrueSurfaces& surfaces, const Trajectory& truth,
                                    const MapEvaluationConfig& config) {
  WorldConfig slice;
  slice.ceiling_m = 0.0;
  slice.bounds = {-1e3, -1e3, 1e3, 1e3};
  slice.solids = surfaces.solids();
  for (Solid& solid : slice.solids) {
    solid.bottom_m = 0.0;
    solid.top_m = 2.0;
  }
  const WorldMeshes meshes(slice);
  const Scene scene(meshes);
  struct Sample {
    Point2 sum{0.0, 0.0};
    int hits = 0, sightings = 0;
    std::size_t last_pose = 0;
  };
  std::unordered_map<std::uint64_t, Sample> samples;
  Pose2 last;
  std::size_t pose_count = 0;
  const int rays = static_cast<int>(config.range_m / kSample_m * config.fov_deg * kPi / 180.0 * 2.0);
  for (const StampedPose2& stamped : truth) {
    const Pose2& base = stamped.T_map_robot;
    const bool moved = pose_count == 0 || distance_m(base, last) > 0.1 ||
                       std::abs(normalize_angle_rad(base.yaw_rad - last.yaw_rad)) > 0.1;
    if (!moved) continue;
    last = base;
    ++pose_count;
    const Pose2 camera = base * Pose2{config.camera_forward_m, 0, 0};
    const Eigen::Vector3f origin(static_cast<float>(camera.x_m), static_cast<float>(camera.y_m), 1.0f);
    for (int i = 0; i < rays; ++i) {
      const double angle =
          camera.yaw_rad + (static_cast<double>(i) / (rays - 1) - 0.5) * config.fov_deg * kPi / 180.0;
      const Eigen::Vector3f direction(static_cast<float>(std::cos(angle)),
                                      static_cast<float>(std::sin(angle)), 0.0f);
      const float range = scene.cast(origin, direction, static_cast<float>(config.range_m));
      if (!std::isfinite(range)) continue;
      const Point2 hit{camera.x_m + range * std::cos(angle), camera.y_m + range * std::sin(angle)};
      Sample& sample = samples[cell_key({hit.x_m + kOffset_m, hit.y_m + kOffset_m}, kSample_m)];
      sample.sum.x_m += hit.x_m;
      sample.sum.y_m += hit.y_m;
      ++sample.hits;
      if (sample.last_pose != pose_count) {
        sample.last_pose = pose_count;
        ++sample.sightings;
      }
    }
  }
  std::vector<Point2> result;
  for (const auto& entry : samples) {
    const Sample& sample = entry.second;
    if (sample.sightings < config.sightings) continue;
    result.push_back({sample.sum.x_m / sample.hits, sample.sum.y_m / sample.hits});
  }
  std::sort(result.begin(), result.end(),
            [](const Point2& a, const Point2& b) { return a.x_m != b.x_m ? a.x_m < b.x_m : a.y_m < b.y_m; });
  return result;
}

}  // namespace

std::vector<Point2> zero_contour(const DistanceMap& map) {
  const GridGeometry& g = map.geometry;
  std::vector<Point2> contour;
  const auto crossing = [&](int ix, int iy, int jx, int jy) {
    const float a = map.at(ix, iy), b = map.at(jx, jy);
    if (!std::isfinite(a) || !std::isfinite(b) || (a < 0.0f) == (b < 0.0f)) return;
    // A distance cannot change by more than the step between cells; a leap is where two surfaces' inner sides
    // meet.
    if (std::abs(a - b) > 2.0 * g.resolution_m) return;
    const double t = a / (a - b);
    contour.push_back({g.center_x_m(ix) + t * (jx - ix) * g.resolution_m,
                       g.center_y_m(iy) + t * (jy - iy) * g.resolution_m});
  };
  for (int iy = 0; iy < g.height_cells; ++iy) {
    for (int ix = 0; ix < g.width_cells; ++ix) {
      crossing(ix, iy, ix + 1, iy);
      crossing(ix, iy, ix, iy + 1);
    }
  }
  return contour;
}

TrueSurfaces::TrueSurfaces(const WorldConfig& world, double low_m, double high_m) {
  for (const Solid& solid : solids_at(world, 0.0)) {
    if (solid.material == Material::kGlass || solid.top_m <= low_m || solid.bottom_m >= high_m) continue;
    solids_.push_back(solid);
    for (std::size_t i = 0; i < solid.corners.size(); ++i) {
      edges_.push_back({solid.corners[i], solid.corners[(i + 1) % solid.corners.size()]});
    }
  }
  const FloorRect& b = world.bounds;
  buckets_.resolution_m = 0.5;
  buckets_.origin_x_m = b.min_x_m - 2.0;
  buckets_.origin_y_m = b.min_y_m - 2.0;
  buckets_.width_cells = static_cast<int>((b.max_x_m - b.min_x_m + 4.0) / buckets_.resolution_m) + 1;
  buckets_.height_cells = static_cast<int>((b.max_y_m - b.min_y_m + 4.0) / buckets_.resolution_m) + 1;
  bucket_.resize(buckets_.cell_count());
  constexpr double kReach_m = 1.0;  // the longest limit asked for
  for (std::uint32_t i = 0; i < edges_.size(); ++i) {
    const Edge& e = edges_[i];
    const double reach = kReach_m + 0.36;
    const int x0 = buckets_.cell_x(std::min(e.a.x_m, e.b.x_m) - reach),
              x1 = buckets_.cell_x(std::max(e.a.x_m, e.b.x_m) + reach);
    const int y0 = buckets_.cell_y(std::min(e.a.y_m, e.b.y_m) - reach),
              y1 = buckets_.cell_y(std::max(e.a.y_m, e.b.y_m) + reach);
    for (int iy = y0; iy <= y1; ++iy) {
      for (int ix = x0; ix <= x1; ++ix) {
        if (!buckets_.contains(ix, iy)) continue;
        const Point2 center{buckets_.center_x_m(ix), buckets_.center_y_m(iy)};
        if (segment_distance_m(e.a, e.b, center) < reach) bucket_[buckets_.index(ix, iy)].push_back(i);
      }
    }
  }
}

bool TrueSurfaces::nearest(const Point2& p, double limit_m, Point2* on_surface) const {
  const int ix = buckets_.cell_x(p.x_m), iy = buckets_.cell_y(p.y_m);
  if (!buckets_.contains(ix, iy)) return false;
  double best = limit_m;
  bool found = false;
  for (const std::uint32_t i : bucket_[buckets_.index(ix, iy)]) {
    const Edge& e = edges_[i];
    const double dx = e.b.x_m - e.a.x_m, dy = e.b.y_m - e.a.y_m, length2 = dx * dx + dy * dy;
    if (length2 <= 0.0) continue;
    const double t = std::clamp(((p.x_m - e.a.x_m) * dx + (p.y_m - e.a.y_m) * dy) / length2, 0.0, 1.0);
    const Point2 q{e.a.x_m + t * dx, e.a.y_m + t * dy};
    const double d = std::hypot(p.x_m - q.x_m, p.y_m - q.y_m);
    if (d >= best) continue;
    best = d;
    found = true;
    *on_surface = q;
  }
  return found;
}

MapEvaluation evaluate_map(const DistanceMap& map, const WorldConfig& world, const Trajectory& truth,
                           const MapEvaluationConfig& config) {
  if (truth.empty()) throw UserError("evaluate_map: the true trajectory is empty.");
  const std::vector<Point2> contour = zero_contour(map);
  if (contour.size() < 10) throw UserError("evaluate_map: the map has no contour.");
  const TrueSurfaces surfaces(world, config.slice_low_m, config.slice_high_m);
  MapEvaluation result;
  const Pose2 start = truth.front().T_map_robot;
  result.T_world_map = align(contour, surfaces, start);
  result.T_start_map = start.inverse() * result.T_world_map;

  std::vector<double> error_m;
  double sum2 = 0.0;
  for (const Point2& p : contour) {
    const Point2 at = result.T_world_map * p;
    Point2 hit;
    // Beyond a metre it counts as a metre.
    const double d = surfaces.nearest(at, 1.0, &hit) ? std::hypot(at.x_m - hit.x_m, at.y_m - hit.y_m) : 1.0;
    error_m.push_back(d);
    sum2 += d * d;
    if (d > kOutlier_m) result.outlier_fraction += 1.0;
    result.contour_world.push_back(at);
  }
  const auto count = static_cast<double>(error_m.size());
  result.rmse_m = std::sqrt(sum2 / count);
  result.outlier_fraction /= count;
  result.contour_length_m =
      count * map.geometry.resolution_m * kPi / 4.0;  // crossings a metre, mean over directions
  std::sort(error_m.begin(), error_m.end());
  result.median_m = error_m[error_m.size() / 2];
  result.percentile_95_m = error_m[error_m.size() * 95 / 100];

  result.visible = visible_surface(surfaces, truth, config);
  const PointIndex index(result.contour_world, config.match_m);
  for (const Point2& p : result.visible) {
    if (!index.any_within_reach(p)) result.missed.push_back(p);
  }
  const auto visible = static_cast<double>(result.visible.size());
  result.visible_length_m = visible * kSample_m;
  result.completeness = visible > 0.0 ? 1.0 - static_cast<double>(result.missed.size()) / visible : 0.0;
  return result;
}

cv::Mat evaluation_picture(const MapEvaluation& evaluation, const WorldConfig& world, const Trajectory& truth,
                           const MapEvaluationConfig& config) {
  WorldPicture picture(world);
  picture.draw_slice(config.slice_low_m, config.slice_high_m);
  std::vector<Point2> path;
  for (const StampedPose2& stamped : truth)
    path.push_back({stamped.T_map_robot.x_m, stamped.T_map_robot.y_m});
  picture.draw_path(path, cv::Scalar(80, 180, 80));
  for (const Point2& p : evaluation.missed) picture.draw_point(p, cv::Scalar(0, 0, 255), 2);
  for (const Point2& p : evaluation.contour_world) picture.draw_point(p, cv::Scalar(220, 90, 20), 1);
  return picture.image();
}

}  // namespace knav
