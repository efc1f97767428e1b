#include "tsdf_local_mapper/close_obstacles.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace knav {
namespace {

constexpr double kSuddenly_s = 0.5;
constexpr double kLooksFrom_m = 0.1, kSeesFrom_m = 0.6;  ///< a Kinect sees from 0.5 m; and some noise
constexpr double kApart_m = 0.03;  ///< of the points that stand for it: less than a cell
constexpr double kBaseline_m = 0.075;  ///< of a Kinect's projector and camera
constexpr std::size_t kBeside = 4;      ///< columns
constexpr double kNever = -std::numeric_limits<double>::infinity();

}  // namespace

void CloseObstacles::reset() {
  shown_s_.clear();
  lost_.clear();
  held_.clear();
}

void CloseObstacles::update(const DepthProfile& profile, const Pose2& T_local_camera, const TsdfGrid& grid) {
  // Who makes profiles by hand may leave the classes out: then nothing is known to be blind.
  if (config_.distance_m <= 0.0 || profile.height_class.size() != profile.z_m.size()) return;
  find_blind_columns(profile);
  forget(profile, T_local_camera);
  for (std::size_t u = 0; u < lost_.size(); ++u) {
    known_depth_m_[u] = lost_[u] != 0 ? known_depth(T_local_camera, left_per_m(profile, u), grid) : 0.0f;
  }
  for (std::size_t first = 0; first < lost_.size();) {
    if (!hides(first)) {
      ++first;
      continue;
    }
    std::size_t end = first;
    while (end < lost_.size() && hides(end)) ++end;
    hold_between(profile, T_local_camera, first, end);
    first = end;
  }
}

double CloseObstacles::left_per_m(const DepthProfile& profile, std::size_t column) {
  return -(static_cast<double>(column) - profile.cx_px) / profile.fx_px;
}

/// The depth of what the map has where the camera is blind, that would hide what is behind; infinite for nothing.
float CloseObstacles::known_depth(const Pose2& T_local_camera, double left_per_m, const TsdfGrid& grid) {
  for (double depth_m = kLooksFrom_m; depth_m <= kSeesFrom_m; depth_m += 0.5 * grid.resolution_m()) {
    const Point2 p = T_local_camera * Point2{depth_m, left_per_m * depth_m};
    const int ix = grid.cell_of(p.x_m), iy = grid.cell_of(p.y_m);
    if (grid.contains(ix, iy) && grid.known(ix, iy) && grid.value(ix, iy) <= 0) return static_cast<float>(depth_m);
  }
  return std::numeric_limits<float>::infinity();
}

/// Whether a column is blind for something that the map does not have.
bool CloseObstacles::hides(std::size_t column) const { return lost_[column] != 0 && std::isinf(known_depth_m_[column]); }

/// Holds what stands before the columns from first to end, unless they are no more than the shadow of the known surface
/// beside them.
void CloseObstacles::hold_between(const DepthProfile& profile, const Pose2& T_local_camera, std::size_t first, std::size_t end) {
  float beside_m = std::numeric_limits<float>::infinity();
  if (first > 0 && lost_[first - 1] != 0) beside_m = known_depth_m_[first - 1];
  if (end < lost_.size() && lost_[end] != 0) beside_m = std::min(beside_m, known_depth_m_[end]);
  const double shadow_px = kBaseline_m * profile.fx_px / static_cast<double>(beside_m);
  if (static_cast<double>(end - first) < static_cast<double>(fewest_columns(profile)) + shadow_px) return;
  const auto apart_px = static_cast<std::size_t>(std::max(1.0, std::ceil(kApart_m * profile.fx_px / config_.distance_m)));
  for (std::size_t u = first; u < end; u += apart_px) {
    hold(T_local_camera * Point2{config_.distance_m, left_per_m(profile, u) * config_.distance_m}, profile.stamp_s);
  }
}

/// How many columns beside a run of blind ones the shadow may fill that a near surface throws: projector and camera look
/// past its edge from places a baseline apart.
std::size_t CloseObstacles::shadow_columns(const DepthProfile& profile, std::size_t first, std::size_t end) {
  float nearest_m = std::numeric_limits<float>::infinity();
  for (std::size_t k = 1; k <= kBeside; ++k) {
    if (first >= k) nearest_m = std::fmin(nearest_m, profile.z_m[first - k]);
    if (end + k <= profile.z_m.size()) nearest_m = std::fmin(nearest_m, profile.z_m[end + k - 1]);
  }
  if (!(nearest_m > 0.0f)) return profile.z_m.size();
  return static_cast<std::size_t>(std::min(kBaseline_m * profile.fx_px / static_cast<double>(nearest_m), static_cast<double>(profile.z_m.size())));
}

std::size_t CloseObstacles::fewest_columns(const DepthProfile& profile) const {
  return static_cast<std::size_t>(std::max(1.0, std::tan(config_.width_deg * kPi / 180.0) * profile.fx_px));
}

bool CloseObstacles::goes_blind(std::size_t column, double stamp_s) const {
  return lost_[column] != 0 || stamp_s - shown_s_[column] <= kSuddenly_s;
}

void CloseObstacles::find_blind_columns(const DepthProfile& profile) {
  const std::size_t columns = profile.height_class.size();
  if (shown_s_.size() != columns) {
    shown_s_.assign(columns, kNever);
    lost_.assign(columns, 0);
    known_depth_m_.assign(columns, 0.0f);
  }
  const std::size_t fewest = fewest_columns(profile);
  for (std::size_t first = 0; first < columns;) {
    if (profile.height_class[first] != HeightClass::kBlind) {
      shown_s_[first] = profile.stamp_s;
      lost_[first++] = 0;
      continue;
    }
    // Beside a border that never shows anything lie columns that flicker: they are too few.
    std::size_t end = first, went_blind = 0;
    for (; end < columns && profile.height_class[end] == HeightClass::kBlind; ++end) went_blind += goes_blind(end, profile.stamp_s) ? 1 : 0;
    const bool somebody = went_blind >= fewest && end - first >= fewest + shadow_columns(profile, first, end);
    for (std::size_t u = first; u < end && somebody; ++u) {
      if (goes_blind(u, profile.stamp_s)) lost_[u] = 1;
    }
    first = end;
  }
}

/// What stands where a column shows something now has gone, or is far enough for the camera to see.
void CloseObstacles::forget(const DepthProfile& profile, const Pose2& T_local_camera) {
  const Pose2 T_camera_local = T_local_camera.inverse();
  const auto gone = [&](const Held& held) {
    const double age_s = profile.stamp_s - held.seen_s;
    if (!(age_s >= 0.0 && age_s <= config_.memory_s)) return true;
    const Point2 p = T_camera_local * held.in_local;
    if (p.x_m <= 0.05) return false;
    const auto u = std::lround(profile.cx_px - profile.fx_px * p.y_m / p.x_m);
    return u >= 0 && u < static_cast<long>(lost_.size()) &&
           profile.height_class[static_cast<std::size_t>(u)] != HeightClass::kBlind;
  };
  held_.erase(std::remove_if(held_.begin(), held_.end(), gone), held_.end());
}

void CloseObstacles::hold(const Point2& in_local, double stamp_s) {
  for (Held& held : held_) {
    if (std::hypot(held.in_local.x_m - in_local.x_m, held.in_local.y_m - in_local.y_m) >= 0.5 * kApart_m) continue;
    held.seen_s = stamp_s;
    return;
  }
  held_.push_back({in_local, stamp_s});
}

void CloseObstacles::add_to(const Pose2& T_local_base, RangeScan* scan) const {
  const Pose2 T_base_local = T_local_base.inverse();
  const auto rays = static_cast<std::ptrdiff_t>(scan->range_m.size());
  for (const Held& held : held_) {
    const Point2 p = T_base_local * held.in_local;
    const double range_m = std::hypot(p.x_m, p.y_m), increment_rad = scan->angle_increment_rad;
    const double from_rad = std::atan2(p.y_m, p.x_m) - std::atan2(kApart_m, range_m);
    const double to_rad = from_rad + 2.0 * std::atan2(kApart_m, range_m);
    const auto last = static_cast<std::ptrdiff_t>(std::floor((to_rad - scan->angle_min_rad) / increment_rad));
    for (auto ray = static_cast<std::ptrdiff_t>(std::ceil((from_rad - scan->angle_min_rad) / increment_rad)); ray <= last; ++ray) {
      const auto i = static_cast<std::size_t>((ray % rays + rays) % rays);
      if (scan->range_m[i] <= range_m) continue;
      scan->range_m[i] = static_cast<float>(range_m);
      if (i < scan->evidence.size()) scan->evidence[i] = 0.0f;
    }
  }
}

void CloseObstacles::add_to(OccupancyGrid* local_map) const {
  const GridGeometry& g = local_map->geometry;
  for (const Held& held : held_) {
    const int ix = g.cell_x(held.in_local.x_m), iy = g.cell_y(held.in_local.y_m);
    if (g.contains(ix, iy)) local_map->value[g.index(ix, iy)] = 100;
  }
}

}  // namespace knav
