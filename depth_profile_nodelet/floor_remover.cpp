#include "depth_profile_nodelet/floor_remover.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/multiversion.h"
#include "depth_profile_nodelet/profile_extractor.h"
#include "kinect_calib/kinect_noise.h"

namespace knav {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kFollowedFrom_m = 0.8f;  // nearer the sensor may see nothing
/// A camera that shows the floor from here on always sees some of it, unless something stands before it.
constexpr float kFloorAlwaysFrom_m = 4.0f;
constexpr float kStrays = 3.0f;  // readings in a column that shows nothing: fewer than this

/// For one row: with x the normalised column of the source pixel, up . ray = up_x x + up_row, and the same
/// for forward.
struct RowTerms {
  float up_x, up_row, forward_x, forward_row;
  float height_m, bottom_m, bottom_per_m, top_m;
};

/// Normalised source columns of a levelled row: x = (a x' + b) / (c x' + d).
KNAV_MULTIVERSION
void source_columns(float a, float b, float c, float d, float per_fx, float cx_px, int width, float* x) {
  for (int u = 0; u < width; ++u) {
    const float levelled = (static_cast<float>(u) - cx_px) * per_fx;
    x[u] = (a * levelled + b) / (c * levelled + d);
  }
}

/// Levelled distance of what lies in the slice, else NaN.
KNAV_MULTIVERSION
void slice_row(const float* z_m, const float* x, int width, const RowTerms& terms, float* sliced_m) {
  const RowTerms t = terms;
  for (int u = 0; u < width; ++u) {
    const float forward = z_m[u] * (t.forward_x * x[u] + t.forward_row);
    const float height = z_m[u] * (t.up_x * x[u] + t.up_row) + t.height_m;
    const bool keep =
        (height > t.bottom_m + t.bottom_per_m * forward) & (height < t.top_m) & (forward > 0.0f);
    sliced_m[u] = keep ? forward : kNaN;
  }
}

struct FollowTerms {
  float gap_m, gap_per_m;      ///< the floor may be interrupted this far, more with distance
  float follow_to_m;           ///< farther off the floor's readings are noise
  float floor_range_m;         ///< rows that meet the floor farther off belong to the sweep
  float below_m, below_per_m;  ///< readings this far under the floor are a drop
  float begin_m;               ///< where the view's lower edge meets the floor: it is followed from there
};

/// One step of following the floor up the columns, the lowest row first.
KNAV_MULTIVERSION
void follow_row(const float* z_m, const float* x, int width, const RowTerms& terms, const FollowTerms& follow,
                float* free_from, float* free_to, float* alive, float* floor_rows, float* below_rows,
                float* sweep_rows, float* sweep_seen, float* seen_rows) {
  const RowTerms t = terms;
  const FollowTerms f = follow;
  // Every value is loaded before it is chosen between, and masks are 0 / 1: else the loop does not vectorise.
#pragma GCC ivdep
  for (int u = 0; u < width; ++u) {
    const float z = z_m[u], to = free_to[u], from = free_from[u], was_alive = alive[u];
    const float forward_ray = t.forward_x * x[u] + t.forward_row;
    const float up_ray = t.up_x * x[u] + t.up_row;
    const float forward = z * forward_ray;
    const float height = z * up_ray + t.height_m;
    const float fall = up_ray < -1e-4f ? -up_ray : 1e-4f;
    const float expected = t.height_m * forward_ray / fall;  // where this row meets the floor
    const float low = t.bottom_m + t.bottom_per_m * forward;
    const float size = height < 0.0f ? -height : height;
    float on_floor = size <= low ? 1.0f : 0.0f;
    on_floor = expected < f.follow_to_m ? on_floor : 0.0f;
    on_floor = forward < 2.0f * f.follow_to_m ? on_floor : 0.0f;
    const float followed = to > 0.0f ? to : f.begin_m;
    const float living = expected > followed * (1.0f + f.gap_per_m) + f.gap_m ? 0.0f : was_alive;
    const float follows = on_floor * living;
    const float nearer = expected < from ? expected : from;
    const float farther = expected > to ? expected : to;
    alive[u] = living;
    free_from[u] = follows > 0.0f ? nearer : from;
    free_to[u] = follows > 0.0f ? farther : to;
    floor_rows[u] += follows;
    const float below = height < -(f.below_m + f.below_per_m * forward) ? 1.0f : 0.0f;
    below_rows[u] += forward < 2.0f * f.floor_range_m ? below : 0.0f;
    float sweeps = expected > f.floor_range_m ? 1.0f : 0.0f;
    sweeps = up_ray < -1e-4f ? sweeps : 0.0f;
    sweep_rows[u] += sweeps;
    const float seen = z > 0.0f ? 1.0f : 0.0f;
    sweep_seen[u] += seen * sweeps;
    seen_rows[u] += seen;
  }
}

struct ClassTerms {
  float slope, slope_per_px, height_m;  ///< height above the floor = slope of the ray x distance + height_m
  float low_edge_m, high_edge_m;
};

/// Counts what each column's nearest obstacle shows below, within and above the band that stays in view.
KNAV_MULTIVERSION
void class_row(const float* sliced_m, int width, const ClassTerms& terms, const float* from_m,
               const float* to_m, float* low, float* middle, float* high) {
  const ClassTerms t = terms;
#pragma GCC ivdep
  for (int u = 0; u < width; ++u) {
    const float z = sliced_m[u];
    const bool in = (z >= from_m[u]) & (z <= to_m[u]);
    const float height = z * (t.slope + t.slope_per_px * static_cast<float>(u)) + t.height_m;
    low[u] += in & (height < t.low_edge_m) ? 1.0f : 0.0f;
    middle[u] += in & (height >= t.low_edge_m) & (height <= t.high_edge_m) ? 1.0f : 0.0f;
    high[u] += in & (height > t.high_edge_m) ? 1.0f : 0.0f;
  }
}

/// The levelled camera: forward and right parallel to the floor.
struct Level {
  Eigen::Vector3d forward, right, up;
  bool valid;
};
Level level_of(const FloorPlane& plane) {
  Level level;
  level.up = plane.up;
  const Eigen::Vector3d along = Eigen::Vector3d::UnitZ() - plane.up * plane.up.z();
  level.valid = along.norm() > 0.2;  // else it looks straight down or up and has no forward
  level.forward = along.normalized();
  level.right = level.forward.cross(level.up);
  return level;
}

/// Where the row meets the floor, at the farther of its two ends [m]; +Inf if it does not.
float floor_begins_m(const PinholeModel& camera, const Level& level, double height_m, int row) {
  const double y = (row - camera.cy_px) / camera.fy_px;
  double farthest = 0.0;
  for (const double u : {0.0, camera.width_px - 1.0}) {
    const Eigen::Vector3d ray((u - camera.cx_px) / camera.fx_px, y, 1.0);
    const double fall = -level.up.dot(ray);
    if (fall <= 1e-4) return std::numeric_limits<float>::infinity();
    farthest = std::max(farthest, height_m * level.forward.dot(ray) / fall);
  }
  return static_cast<float>(farthest);
}

}  // namespace

void FloorRemover::Columns::reset(int width) {
  const auto size = static_cast<std::size_t>(width);
  free_from_m.assign(size, std::numeric_limits<float>::infinity());
  free_to_m.assign(size, 0.0f);
  alive.assign(size, 1.0f);
  for (auto* counts : {&floor_rows, &below_rows, &sweep_rows, &sweep_seen, &seen_rows}) counts->assign(size, 0.0f);
}

FloorRemover::FloorRemover(const FloorRemovalConfig& config) : config_(config), fit_(config.fit) {
  const DepthProfileConfig profile;
  surface_.configure(profile.support_rows, profile.window_codes * kInverseDepthPerCode, profile.range_max_m);
}

void FloorRemover::process(const cv::Mat& depth, const PinholeModel& camera, double stamp_s,
                           const Eigen::Isometry3d& T_base_optical, cv::Mat* sliced, FloorResult* result) {
  const FloorPlaneFit::Result fitted = fit_.fit(depth, camera, stamp_s, T_base_optical);
  result->plane = fitted.plane;
  result->source = fitted.source;
  result->vote_fraction = fitted.vote_fraction;
  sliced->create(depth.rows, depth.cols, CV_32FC1);
  columns_.reset(depth.cols);
  slice_rows(depth, camera, fitted.plane, sliced);
  conclude(camera, fitted.plane, *sliced, result);
}

void FloorRemover::slice_rows(const cv::Mat& depth, const PinholeModel& camera, const FloorPlane& plane,
                              cv::Mat* sliced) {
  const Level level = level_of(plane);
  if (!level.valid) {
    sliced->setTo(kNaN);
    return;
  }
  row_z_m_.resize(static_cast<std::size_t>(depth.cols));
  source_x_.resize(static_cast<std::size_t>(depth.cols));
  FollowTerms follow{};
  follow.gap_m = 0.15f;
  follow.gap_per_m = 0.15f;
  follow.floor_range_m = static_cast<float>(config_.floor_range_m);
  follow.follow_to_m = static_cast<float>(1.5 * config_.floor_range_m);
  follow.below_m = static_cast<float>(0.05 + 2.0 * config_.slice_bottom_m);
  follow.below_per_m = static_cast<float>(3.0 * config_.slice_bottom_per_m);
  follow.begin_m = std::max(kFollowedFrom_m, floor_begins_m(camera, level, plane.height_m, depth.rows - 1));
  for (int v = depth.rows - 1; v >= 0; --v) {
    const double y = (v - camera.cy_px) / camera.fy_px;
    const auto along_row = [&](const Eigen::Vector3d& axis) { return axis.y() * y + axis.z(); };
    const double forward_row = along_row(level.forward), right_row = along_row(level.right);
    // Levelled column x' = right . ray / forward . ray, solved for the source column x.
    const bool moves = warp_.set({forward_row, -right_row, -level.forward.x(), level.right.x()}, camera.fx_px,
                                 camera.cx_px, depth.cols);
    const float* z_m = depth.ptr<float>(v);
    if (moves) {
      warp_.take(z_m, row_z_m_.data());
      z_m = row_z_m_.data();
    }
    RowTerms terms{};
    terms.up_x = static_cast<float>(level.up.x());
    terms.up_row = static_cast<float>(along_row(level.up));
    terms.forward_x = static_cast<float>(level.forward.x());
    terms.forward_row = static_cast<float>(forward_row);
    terms.height_m = static_cast<float>(plane.height_m);
    terms.bottom_m = static_cast<float>(config_.slice_bottom_m);
    terms.bottom_per_m = static_cast<float>(config_.slice_bottom_per_m);
    terms.top_m = static_cast<float>(config_.slice_top_m);
    const float* x = source_x_.data();
    source_columns(static_cast<float>(forward_row), static_cast<float>(-right_row),
                   static_cast<float>(-level.forward.x()), static_cast<float>(level.right.x()),
                   static_cast<float>(1.0 / camera.fx_px), static_cast<float>(camera.cx_px), depth.cols,
                   source_x_.data());
    slice_row(z_m, x, depth.cols, terms, sliced->ptr<float>(v));
    const float steepest =
        terms.up_row - std::abs(terms.up_x) * std::max(std::abs(x[0]), std::abs(x[depth.cols - 1]));
    if (steepest < 0.0f) {
      follow_row(z_m, x, depth.cols, terms, follow, columns_.free_from_m.data(), columns_.free_to_m.data(),
                 columns_.alive.data(), columns_.floor_rows.data(), columns_.below_rows.data(),
                 columns_.sweep_rows.data(), columns_.sweep_seen.data(), columns_.seen_rows.data());
    }
  }
}

void FloorRemover::conclude(const PinholeModel& camera, const FloorPlane& plane, const cv::Mat& sliced,
                            FloorResult* result) {
  const auto width = static_cast<std::size_t>(sliced.cols);
  result->free_from_m.assign(width, kNaN);
  result->free_to_m.assign(width, kNaN);
  result->height_class.assign(width, HeightClass::kNone);
  surface_.find(sliced, camera.fy_px);
  classify(camera, plane, sliced);
  const std::vector<float>& nearest_m = surface_.nearest_m();
  const auto floor_range_m = static_cast<float>(config_.floor_range_m);
  const Level level = level_of(plane);
  const bool floor_in_view = level.valid && floor_begins_m(camera, level, plane.height_m, sliced.rows - 1) < kFloorAlwaysFrom_m;
  for (std::size_t u = 0; u < width; ++u) {
    const float z = nearest_m[u];
    const bool surface = !std::isnan(z);
    if (surface) {
      result->height_class[u] = middle_seen_[u] >= 2.0f ? HeightClass::kMiddle
                                : low_seen_[u] > 0.0f   ? HeightClass::kLow
                                                        : HeightClass::kHigh;
    } else if (floor_in_view && columns_.seen_rows[u] < kStrays) {
      result->height_class[u] = HeightClass::kBlind;
    }
    const bool drop = columns_.below_rows[u] >= 3.0f;
    float from = columns_.free_from_m[u], to = columns_.free_to_m[u];
    const bool swept =
        columns_.sweep_rows[u] > 0.0f && columns_.sweep_seen[u] >= 0.5f * columns_.sweep_rows[u];
    if (columns_.floor_rows[u] >= 3.0f) {
      if (surface) {
        const bool reached = to >= std::min(0.95f * floor_range_m, 0.9f * z - 0.2f);
        // The surface lies somewhere in its window: the profile, which knows where, ends the interval there.
        const float far_side = surface_.window_end_m()[u];
        to = reached && (z <= floor_range_m || swept) && !drop ? far_side : std::min(to, far_side);
      }
    } else if (config_.free_without_floor && surface && !drop) {
      from = static_cast<float>(config_.view_near_m);
      to = surface_.window_end_m()[u];
    } else {
      continue;
    }
    if (from < to) {
      result->free_from_m[u] = from;
      result->free_to_m[u] = to;
    }
  }
}

void FloorRemover::classify(const PinholeModel& camera, const FloorPlane& plane, const cv::Mat& sliced) {
  const auto width = static_cast<std::size_t>(sliced.cols);
  low_seen_.assign(width, 0.0f);
  middle_seen_.assign(width, 0.0f);
  high_seen_.assign(width, 0.0f);
  const Level level = level_of(plane);
  if (!level.valid) return;
  // How steeply the levelled column u' looks up in row v: up . ray / forward . ray of its source pixel.
  const auto slope = [&](double u_levelled, double v) {
    const double y = (v - camera.cy_px) / camera.fy_px,
                 x_levelled = (u_levelled - camera.cx_px) / camera.fx_px;
    const auto along_row = [&](const Eigen::Vector3d& axis) { return axis.y() * y + axis.z(); };
    const double x = (x_levelled * along_row(level.forward) - along_row(level.right)) /
                     (level.right.x() - x_levelled * level.forward.x());
    return (level.up.x() * x + along_row(level.up)) / (level.forward.x() * x + along_row(level.forward));
  };
  ClassTerms terms{};
  terms.height_m = static_cast<float>(plane.height_m);
  terms.low_edge_m =
      static_cast<float>(plane.height_m + config_.view_near_m * slope(camera.cx_px, sliced.rows - 1));
  terms.high_edge_m = static_cast<float>(plane.height_m + config_.view_near_m * slope(camera.cx_px, 0));
  for (int v = 0; v < sliced.rows; ++v) {
    const double left = slope(0, v), right = slope(sliced.cols - 1, v);
    terms.slope = static_cast<float>(left);
    terms.slope_per_px = static_cast<float>((right - left) / std::max(1, sliced.cols - 1));
    class_row(sliced.ptr<float>(v), sliced.cols, terms, surface_.nearest_m().data(),
              surface_.window_end_m().data(), low_seen_.data(), middle_seen_.data(), high_seen_.data());
  }
}

}  // namespace knav
