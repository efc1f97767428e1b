#include "tools/mapper_accuracy.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "tools/mapper_trajectory.h"

namespace knav {
namespace {

constexpr double kYoung_s = 10.0, kNear_m = 8.0, kBeside_m = 0.1;
constexpr double kFalse_m = 0.3, kFalseShare = 0.05;
constexpr double kLost_m = 2.0;
constexpr double kTruthStep_s = 0.2;  ///< a segment starts this often

/// The nearest and the farthest thing within kBeside_m beside ray i at about its range.
void around(const RangeScan& perfect, std::size_t i, double range_m, float* nearest, float* farthest) {
  const auto n = static_cast<std::ptrdiff_t>(perfect.range_m.size());
  const double half_rad = std::min(0.2, kBeside_m / std::max(0.3, range_m));
  const auto reach = static_cast<std::ptrdiff_t>(std::ceil(half_rad / perfect.angle_increment_rad));
  *nearest = std::numeric_limits<float>::infinity();
  *farthest = 0.0f;
  for (std::ptrdiff_t k = -reach; k <= reach; ++k) {
    const float r = perfect.range_m[static_cast<std::size_t>((static_cast<std::ptrdiff_t>(i) + k + n) % n)];
    *nearest = std::min(*nearest, r);
    *farthest = std::max(*farthest, r);
  }
}

Trajectory thinned(const Trajectory& trajectory) {
  Trajectory thin;
  for (const StampedPose2& pose : trajectory) {
    if (thin.empty() || pose.stamp_s - thin.back().stamp_s >= kTruthStep_s) thin.push_back(pose);
  }
  return thin;
}

}  // namespace

void ScanAccuracy::add(const RangeScan& scan, double evidence_decay_s, const RangeScan& perfect) {
  const double youngest = std::exp(-kYoung_s / evidence_decay_s);
  const std::size_t n = scan.range_m.size();
  for (std::size_t i = 0; i < n; ++i) {
    if (std::isnan(scan.range_m[i]) || scan.evidence[i] < youngest) continue;
    const std::size_t k = i * perfect.range_m.size() / n;
    const float truth = perfect.range_m[k];
    const bool free = std::isinf(scan.range_m[i]);
    const double r = free ? scan.range_max_m : static_cast<double>(scan.range_m[i]);
    ++rays;
    float nearest, farthest;
    around(perfect, k, r, &nearest, &farthest);
    const double tolerance = std::max(kFalse_m, kFalseShare * r);
    if (!free && nearest - r > tolerance) ++false_obstacles;
    around(perfect, k, truth, &nearest, &farthest);
    if (farthest < kNear_m && r - farthest > tolerance) ++misses;
    if (!free && truth <= kNear_m) error_m.push_back(static_cast<float>(std::fabs(r - truth)));
  }
}

ScanShare ScanShare::of(const RangeScan& scan, const RangeScan& perfect) {
  std::size_t near = 0, seen = 0;
  for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
    const float truth = perfect.range_m[i * perfect.range_m.size() / scan.range_m.size()];
    if (!(truth <= kNear_m)) continue;
    ++near;
    seen += std::fabs(scan.range_m[i] - truth) <= kFalse_m ? 1 : 0;
  }
  return {scan.stamp_s, near == 0 ? 0.0 : static_cast<double>(seen) / static_cast<double>(near)};
}

void ScanAccuracy::add(const ScanAccuracy& other) {
  rays += other.rays;
  false_obstacles += other.false_obstacles;
  misses += other.misses;
  error_m.insert(error_m.end(), other.error_m.begin(), other.error_m.end());
}

double ScanAccuracy::quantile_m(double share) const {
  if (error_m.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::vector<float> sorted = error_m;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(sorted.size() - 1));
  std::nth_element(sorted.begin(), sorted.begin() + at, sorted.end());
  return sorted[static_cast<std::size_t>(at)];
}

MapperAccuracy measure_mapper(const ProfileRecording& recording, const LocalMapperConfig& config,
                              bool scans, const RangeOffsets* known) {
  MapperAccuracy accuracy;
  LocalMapper mapper(config);
  if (known) mapper.start_from(*known);
  MapperTrajectory trajectory;
  DepthProfile profile;
  RangeScan scan, perfect;
  std::size_t next_odometry = 0, next_scan = 0;
  double last_lifespan_s = 0.0;
  const auto start = std::chrono::steady_clock::now();
  for (std::size_t i = 0; i < recording.frames(); ++i) {
    recording.profile(i, &profile);
    // What a robot has when the image is out, half a readout after its stamp.
    const double out_s = profile.stamp_s + 1.0 / 60.0;
    for (; next_odometry < recording.odometry.size() && recording.odometry[next_odometry].stamp_s <= out_s;
         ++next_odometry) {
      mapper.add_odometry(recording.odometry[next_odometry].stamp_s,
                          recording.odometry[next_odometry].T_map_robot);
    }
    const LocalMapperResult& result = mapper.update(profile, recording.T_base_camera);
    trajectory.add(result);
    if (result.accepted && result.particle_lifespan_s != last_lifespan_s) {
      last_lifespan_s = result.particle_lifespan_s;
      accuracy.lifespan_s.push_back(last_lifespan_s);
    }
    if (!scans || next_scan == recording.perfect_scans.size() ||
        recording.perfect_scans[next_scan].frame != i)
      continue;
    ProfileRecording::perfect_scan(recording.perfect_scans[next_scan++], &perfect);
    if (!result.accepted) continue;
    mapper.extract_scan_360(&scan);
    accuracy.scan.add(scan, config.contour.evidence_decay_s, perfect);
    accuracy.shares.push_back(ScanShare::of(scan, perfect));
  }
  accuracy.elapsed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const Trajectory truth = thinned(recording.truth);
  for (std::size_t k = 0; k < 3; ++k) {
    accuracy.segment[k] = segment_error(trajectory.estimate(), truth, MapperAccuracy::kLengths_m[k]);
    accuracy.odometry_segment[k] = segment_error(trajectory.odometry(), truth, MapperAccuracy::kLengths_m[k]);
  }
  accuracy.lost = accuracy.segment[0].translation_max_m > kLost_m;
  accuracy.estimate = trajectory.estimate();
  accuracy.odometry = trajectory.odometry();
  accuracy.learned = mapper.range_offsets();
  accuracy.epochs = trajectory.epochs();
  accuracy.path_m = trajectory.path_m();
  if (recording.frames() > 0)
    accuracy.duration_s = recording.stamp_s(recording.frames() - 1) - recording.stamp_s(0);
  return accuracy;
}

}  // namespace knav
