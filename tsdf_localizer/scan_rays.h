#pragma once

#include <cstddef>
#include <vector>

#include "core/pose2.h"
#include "core/range_scan.h"
#include "tsdf_localizer/localizer_config.h"
#include "tsdf_localizer/price_field.h"

namespace knav {

/// The rays of a scan that say something about the pose: returns, with evidence, within the range limits.
struct ScanRays {
  WeightedPoints points;        ///< end points in base_link; weight from evidence and range
  std::vector<float> range_m;   ///< from the sensor
  std::vector<float> evidence;  ///< in (0, 1]
  Pose2 T_base_sensor;
  std::size_t unknown = 0;  ///< rays without a return or without evidence, of those looked at
  std::size_t size() const { return points.size(); }
  void clear();
};

/// Takes every n-th ray, so that at most laser_max_beams are looked at; `phase` picks which of the n. Returns
/// false if the scan is no scan (no rays, or angles that are not finite).
///
/// A ray's weight is its evidence, times noise_m over its noise: a reading at 10 m may be 0.2 m wrong and
/// must not weigh as much as ten near ones.
/// @param evidence_min   rays with less are left out, beside those that the configuration leaves out
/// @param evidence_power a ray weighs its evidence to this power
bool select_rays(const RangeScan& scan, const Pose2& T_base_sensor, const LocalizerConfig& config,
                 std::size_t phase, double evidence_min, double evidence_power, ScanRays* rays);

/// Every n-th of them, so that at most `count` remain.
void thin_out(const ScanRays& rays, std::size_t count, ScanRays* fewer);

/// Drivers of laser scanners put reflectivity in `intensities`. Values are evidence only if all lie in [0, 1]
/// and some above 0; otherwise they are dropped (every ray then counts as fresh).
void drop_intensities_that_are_not_evidence(RangeScan* scan);

}  // namespace knav
