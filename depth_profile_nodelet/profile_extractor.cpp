#include "depth_profile_nodelet/profile_extractor.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/pose2.h"
#include "kinect_calib/kinect_noise.h"

namespace knav {

ProfileExtractor::ProfileExtractor(const DepthProfileConfig& config) : config_(config) {
  surface_.configure(config.support_rows, config.window_codes * kInverseDepthPerCode, config.range_max_m);
  for (int i = 0; i <= config.smoothing_radius_px; ++i) {
    const double t = i / config.smoothing_sigma_px;
    spatial_weight_.push_back(static_cast<float>(std::exp(-0.5 * t * t)));
  }
}

void ProfileExtractor::extract(const cv::Mat& sliced, const PinholeModel& camera, double stamp_s,
                               double camera_height_m, const std::vector<float>& free_from_m,
                               const std::vector<float>& free_to_m,
                               const std::vector<HeightClass>& height_class, DepthProfile* profile,
                               const ColumnSurface* found) {
  profile->stamp_s = stamp_s;
  profile->fx_px = camera.fx_px;
  profile->cx_px = camera.cx_px;
  profile->camera_height_m = camera_height_m;
  profile->range_max_m = config_.range_max_m;
  if (config_.method == "paper") {
    ColumnSurface::minimum(sliced, config_.range_max_m, &profile->z_m);
    profile->rows.clear();
  } else {
    if (found && found->finds_the_same(surface_)) {
      surface_.take(*found);
    } else {
      surface_.find(sliced, camera.fy_px);
    }
    surface_.average(&profile->z_m);
    surface_.count_rows(&profile->rows);
  }
  smooth(&profile->z_m);

  const std::size_t width = profile->z_m.size();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  profile->free_from_m.assign(width, nan);
  profile->free_to_m.assign(width, nan);
  profile->height_class.assign(width, HeightClass::kNone);
  for (std::size_t u = 0; u < width; ++u) {
    const float z = profile->z_m[u];
    const HeightClass height = u < height_class.size() ? height_class[u] : HeightClass::kMiddle;
    if (!std::isnan(z) || height == HeightClass::kBlind) profile->height_class[u] = height;
    if (u >= free_from_m.size() || u >= free_to_m.size()) continue;
    const float to = std::isnan(z) ? free_to_m[u] : std::min(free_to_m[u], z);
    if (free_from_m[u] < to) {
      profile->free_from_m[u] = free_from_m[u];
      profile->free_to_m[u] = std::min(to, static_cast<float>(config_.range_max_m));
    }
    // Another stage saw no obstacle where this one does (the paper's minimum takes any stray): it stays in
    // view.
    if (!std::isnan(z) && (profile->height_class[u] == HeightClass::kNone || profile->height_class[u] == HeightClass::kBlind)) {
      profile->height_class[u] = HeightClass::kMiddle;
    }
  }
}

void ProfileExtractor::smooth(std::vector<float>* z_m) {
  if (config_.smoothing_radius_px == 0) return;
  const int width = static_cast<int>(z_m->size());
  const float per_sigma = static_cast<float>(1.0 / (config_.smoothing_sigma_codes * kInverseDepthPerCode));
  inverse_.resize(z_m->size());
  for (std::size_t u = 0; u < z_m->size(); ++u) inverse_[u] = 1.0f / (*z_m)[u];
  for (int u = 0; u < width; ++u) {
    const float centre = inverse_[static_cast<std::size_t>(u)];
    if (std::isnan(centre)) continue;
    float weights = 0.0f, sum = 0.0f;
    const int first = std::max(0, u - config_.smoothing_radius_px);
    const int last = std::min(width - 1, u + config_.smoothing_radius_px);
    for (int i = first; i <= last; ++i) {
      const float value = inverse_[static_cast<std::size_t>(i)];
      const float t = (value - centre) * per_sigma;
      if (!(t * t < 16.0f)) continue;  // NaN, or another surface
      const float weight =
          spatial_weight_[static_cast<std::size_t>(std::abs(i - u))] * std::exp(-0.5f * t * t);
      weights += weight;
      sum += weight * value;
    }
    (*z_m)[static_cast<std::size_t>(u)] = weights / sum;
  }
}

void scan_from_profile(const DepthProfile& profile, const DepthProfileConfig& config, RangeScan* scan) {
  const double fov_rad = config.scan_fov_deg * kPi / 180.0;
  scan->stamp_s = profile.stamp_s;
  scan->angle_min_rad = -0.5 * fov_rad;
  scan->angle_increment_rad = fov_rad / (config.scan_readings - 1);
  scan->range_min_m = config.scan_range_min_m;
  scan->range_max_m = profile.range_max_m;
  scan->range_m.assign(static_cast<std::size_t>(config.scan_readings),
                       std::numeric_limits<float>::quiet_NaN());
  scan->evidence.clear();
  for (int i = 0; i < config.scan_readings; ++i) {
    const double x =
        -std::tan(scan->angle_min_rad + i * scan->angle_increment_rad);  // right is negative angle
    const auto u = std::lround(profile.cx_px + profile.fx_px * x);
    if (u < 0 || u >= static_cast<long>(profile.z_m.size())) continue;
    const auto column = static_cast<std::size_t>(u);
    const double stretch = std::sqrt(1.0 + x * x);
    float& range = scan->range_m[static_cast<std::size_t>(i)];
    if (!std::isnan(profile.z_m[column])) {
      const double along_m = profile.z_m[column] * stretch;
      // At the view's edge a ray of 20 m depth is longer than range_max: it is free that far, then a return
      // too far.
      if (along_m <= profile.range_max_m) {
        range = static_cast<float>(along_m);
      } else if (profile.free_to_m[column] * stretch >= profile.range_max_m) {
        range = std::numeric_limits<float>::infinity();
      }
    } else if (profile.free_to_m[column] * stretch >= profile.range_max_m) {
      range = std::numeric_limits<float>::infinity();
    }
  }
}

}  // namespace knav
