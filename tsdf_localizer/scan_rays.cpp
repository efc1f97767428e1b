#include "tsdf_localizer/scan_rays.h"

#include <algorithm>
#include <cmath>

namespace knav {

void ScanRays::clear() {
  points.clear();
  range_m.clear();
  evidence.clear();
  unknown = 0;
}

bool select_rays(const RangeScan& scan, const Pose2& T_base_sensor, const LocalizerConfig& config,
                 std::size_t phase, double evidence_min, double evidence_power, ScanRays* rays) {
  rays->clear();
  rays->T_base_sensor = T_base_sensor;
  const std::size_t count = scan.range_m.size();
  if (count == 0 || !std::isfinite(scan.angle_min_rad) || !std::isfinite(scan.angle_increment_rad) ||
      scan.angle_increment_rad == 0.0) {
    return false;
  }
  const auto wanted = static_cast<std::size_t>(config.laser_max_beams);
  const std::size_t stride = (count + wanted - 1) / wanted;
  const bool has_evidence = scan.evidence.size() == count;
  evidence_min = std::max(evidence_min, config.measurement.evidence_min);
  const double low_m = std::max(config.laser_min_range, scan.range_min_m);
  const double high_m = config.laser_max_range >= 0.0 ? config.laser_max_range : 1e9;
  for (std::size_t i = phase % stride; i < count; i += stride) {
    const double range = scan.range_m[i];
    const double evidence = has_evidence ? std::min(1.0f, scan.evidence[i]) : 1.0;
    // the comparisons are false for NaN
    if (!(std::isfinite(range) && range > 0.0 && range >= low_m && range <= high_m) ||
        !(evidence > 0.0 && evidence >= evidence_min)) {
      ++rays->unknown;
      continue;
    }
    const double angle = scan.angle_min_rad + scan.angle_increment_rad * static_cast<double>(i);
    const Point2 p = T_base_sensor * Point2{range * std::cos(angle), range * std::sin(angle)};
    const double noise_m =
        config.measurement.noise_m + config.measurement.noise_per_range_squared * range * range;
    rays->points.add(static_cast<float>(p.x_m), static_cast<float>(p.y_m),
                     static_cast<float>(std::pow(evidence, evidence_power) * config.measurement.noise_m / noise_m));
    rays->range_m.push_back(static_cast<float>(range));
    rays->evidence.push_back(static_cast<float>(evidence));
  }
  return true;
}

void thin_out(const ScanRays& rays, std::size_t count, ScanRays* fewer) {
  fewer->clear();
  fewer->T_base_sensor = rays.T_base_sensor;
  fewer->unknown = rays.unknown;
  const std::size_t stride = count == 0 ? 1 : std::max<std::size_t>(1, (rays.size() + count - 1) / count);
  for (std::size_t i = 0; i < rays.size(); i += stride) {
    fewer->points.add(rays.points.x_m[i], rays.points.y_m[i], rays.points.weight[i]);
    fewer->range_m.push_back(rays.range_m[i]);
    fewer->evidence.push_back(rays.evidence[i]);
  }
}

void drop_intensities_that_are_not_evidence(RangeScan* scan) {
  bool some = false;
  for (const float value : scan->evidence) {
    if (value > 1.0f || value < 0.0f) {
      scan->evidence.clear();
      return;
    }
    some = some || value > 0.0f;
  }
  if (!some) scan->evidence.clear();
}

}  // namespace knav
