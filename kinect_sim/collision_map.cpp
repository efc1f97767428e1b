#include "kinect_sim/collision_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace knav {
namespace {
constexpr double kBucket_m = 0.5;
constexpr double kReach_m = 0.75;  ///< exact answers up to here
}  // namespace

CollisionMap::CollisionMap(const WorldConfig& world, double height_m) : world_(&world), height_m_(height_m) {
  for (const Solid& solid : world.solids) {
    if (touches(solid)) solids_.push_back(solid);
  }
  const FloorRect& b = world.bounds;
  bucket_geometry_.resolution_m = kBucket_m;
  bucket_geometry_.origin_x_m = b.min_x_m;
  bucket_geometry_.origin_y_m = b.min_y_m;
  bucket_geometry_.width_cells = static_cast<int>(std::ceil((b.max_x_m - b.min_x_m) / kBucket_m));
  bucket_geometry_.height_cells = static_cast<int>(std::ceil((b.max_y_m - b.min_y_m) / kBucket_m));
  bucket_.resize(bucket_geometry_.cell_count());
  const double reach = kReach_m + kBucket_m;  // half a cell's diagonal and some
  for (std::size_t i = 0; i < solids_.size(); ++i) {
    double x0 = 1e9, y0 = 1e9, x1 = -1e9, y1 = -1e9;
    for (const Point2& c : solids_[i].corners) {
      x0 = std::min(x0, c.x_m - reach);
      y0 = std::min(y0, c.y_m - reach);
      x1 = std::max(x1, c.x_m + reach);
      y1 = std::max(y1, c.y_m + reach);
    }
    const auto& g = bucket_geometry_;
    for (int iy = std::max(0, g.cell_y(y0)); iy <= std::min(g.height_cells - 1, g.cell_y(y1)); ++iy) {
      for (int ix = std::max(0, g.cell_x(x0)); ix <= std::min(g.width_cells - 1, g.cell_x(x1)); ++ix) {
        if (footprint_distance_m(solids_[i], {g.center_x_m(ix), g.center_y_m(iy)}) < reach) {
          bucket_[g.index(ix, iy)].push_back(i);
        }
      }
    }
  }
  for (const TimedSolid& timed : world.timed_solids) timed_.push_back(timed.solid);
  timed_present_.assign(timed_.size(), 0);
  std::vector<double> open;
  for (const DoorConfig& door : world.doors) open.push_back(door.open_rad);
  set_doors(open);
}

void CollisionMap::set_doors(const std::vector<double>& door_open_rad) {
  doors_.clear();
  for (std::size_t i = 0; i < world_->doors.size(); ++i)
    doors_.push_back(door_leaf(world_->doors[i], door_open_rad[i]));
}

void CollisionMap::set_timed(const std::vector<char>& present) { timed_present_ = present; }

double CollisionMap::clearance_m(const Point2& point) const {
  double best = kReach_m;
  const int ix = bucket_geometry_.cell_x(point.x_m), iy = bucket_geometry_.cell_y(point.y_m);
  if (bucket_geometry_.contains(ix, iy)) {
    for (const std::size_t i : bucket_[bucket_geometry_.index(ix, iy)]) {
      best = std::min(best, footprint_distance_m(solids_[i], point));
    }
  }
  for (const Solid& door : doors_) best = std::min(best, footprint_distance_m(door, point));
  for (std::size_t i = 0; i < timed_.size(); ++i) {
    if (timed_present_[i] && touches(timed_[i]))
      best = std::min(best, footprint_distance_m(timed_[i], point));
  }
  return best;
}

double CollisionMap::stairs_distance_m(const Point2& point) const {
  double best = std::numeric_limits<double>::infinity();
  for (const FloorRect& s : world_->stairs) {
    const double dx = std::max({s.min_x_m - point.x_m, 0.0, point.x_m - s.max_x_m});
    const double dy = std::max({s.min_y_m - point.y_m, 0.0, point.y_m - s.max_y_m});
    best = std::min(best, std::hypot(dx, dy));
  }
  return best;
}

}  // namespace knav
