#include "localizer_benchmark/scan_recording.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>

#include "core/error.h"
#include "core/file_io.h"
#include "core/progress.h"
#include "depth_profile_nodelet/profile_extractor.h"
#include "ros_common/program.h"
#include "tools/binary_io.h"
#include "tsdf_local_mapper/local_mapper.h"

namespace knav {
namespace {

constexpr char kMagic[8] = {'k', 'n', 'a', 'v', 's', 'c', 'a', '1'};
constexpr double kStep_m = 0.0005;
constexpr std::uint16_t kUnknown = 65535, kFree = 65534;
constexpr double kOutAfter_s = 1.0 / 60.0;  // the image is out half a readout after its stamp

std::uint16_t packed(float range_m) {
  if (std::isnan(range_m)) return kUnknown;
  const float steps = std::round(range_m / static_cast<float>(kStep_m));
  return steps < kFree ? static_cast<std::uint16_t>(std::max(0.0f, steps)) : kFree;
}

Pose2 true_pose(const ProfileRecording& drive, double stamp_s) {
  Pose2 T;
  if (!interpolate_at(drive.truth, stamp_s, 1.0, &T)) {
    T = (stamp_s < drive.truth.front().stamp_s ? drive.truth.front() : drive.truth.back()).T_map_robot;
  }
  return T;
}

std::size_t first_at_or_after(const Trajectory& trajectory, double stamp_s) {
  const auto at = std::lower_bound(trajectory.begin(), trajectory.end(), stamp_s,
                                   [](const StampedPose2& p, double s) { return p.stamp_s < s; });
  return static_cast<std::size_t>(at - trajectory.begin());
}

}  // namespace

void ScanRecording::add(const Frame& frame, const RangeScan& scan) {
  if (frames.empty()) {
    rays_ = scan.range_m.size();
    angle_min_rad = scan.angle_min_rad;
    angle_increment_rad = scan.angle_increment_rad;
    range_min_m = scan.range_min_m;
    range_max_m = scan.range_max_m;
  }
  if (scan.range_m.size() != rays_) throw UserError("the scans of a recording must have one width.");
  frames.push_back(frame);
  for (std::size_t i = 0; i < rays_; ++i) {
    range_.push_back(packed(scan.range_m[i]));
    const float evidence = scan.evidence.empty() ? 1.0f : scan.evidence[i];
    evidence_.push_back(static_cast<std::uint8_t>(std::lround(255.0f * std::clamp(evidence, 0.0f, 1.0f))));
  }
}

void ScanRecording::scan(std::size_t i, RangeScan* out) const {
  out->stamp_s = frames[i].stamp_s;
  out->angle_min_rad = angle_min_rad;
  out->angle_increment_rad = angle_increment_rad;
  out->range_min_m = range_min_m;
  out->range_max_m = range_max_m;
  out->range_m.resize(rays_);
  out->evidence.resize(rays_);
  for (std::size_t k = 0; k < rays_; ++k) {
    const std::uint16_t steps = range_[i * rays_ + k];
    out->range_m[k] = steps == kUnknown ? std::numeric_limits<float>::quiet_NaN()
                      : steps == kFree  ? std::numeric_limits<float>::infinity()
                                        : static_cast<float>(steps * kStep_m);
    out->evidence[k] = static_cast<float>(evidence_[i * rays_ + k]) / 255.0f;
  }
}

void ScanRecording::save(const std::string& path) const {
  write_file_atomically(path, [&](const std::string& beside) {
    std::ofstream out(beside, std::ios::binary);
    write(out, kMagic);
    write(out, T_base_sensor);
    for (const double value : {angle_min_rad, angle_increment_rad, range_min_m, range_max_m}) write(out, value);
    write(out, rays_);
    write(out, frames);
    write(out, begins);
    write(out, range_);
    write(out, evidence_);
    out.close();
    if (!out) throw UserError(path + ": cannot be written; is the disk full?");
  });
}

ScanRecording ScanRecording::load(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw UserError(path + ": cannot be opened.");
  char magic[8] = {};
  read(in, &magic);
  if (!std::equal(magic, magic + 8, kMagic)) throw UserError(path + ": is no scan recording; delete it.");
  ScanRecording r;
  read(in, &r.T_base_sensor);
  for (double* value : {&r.angle_min_rad, &r.angle_increment_rad, &r.range_min_m, &r.range_max_m}) read(in, value);
  read(in, &r.rays_);
  read(in, &r.frames);
  read(in, &r.begins);
  read(in, &r.range_);
  read(in, &r.evidence_);
  if (!in || r.range_.size() != r.frames.size() * r.rays_ || r.evidence_.size() != r.range_.size()) {
    throw UserError(path + ": is cut short or damaged; delete it, and it will be made again.");
  }
  return r;
}

ScanRecording record_scans(const std::vector<ProfileRecording>& drives, const std::vector<Stretch>& stretches, Link link,
                           const LocalMapperConfig& config, const InDoubt& in_doubt) {
  ScanRecording recording;
  LocalMapper mapper(config);
  DepthProfile profile;
  RangeScan scan;
  Progress progress("map");
  double shift_s = 0.0, ended_s = 0.0;  // of stamps, so that they go on from stretch to stretch
  Pose2 T_shift, T_ended;               // of odometry, likewise
  std::size_t done = 0, all = 0;
  for (const Stretch& s : stretches) all += s.last - s.first;
  for (std::size_t k = 0; k < stretches.size(); ++k) {
    const Stretch& s = stretches[k];
    const ProfileRecording& drive = drives[s.drive];
    std::size_t next = first_at_or_after(drive.odometry, drive.stamp_s(s.first) - 0.1);
    if (k == 0 || link == Link::kAnew) {
      if (k > 0) mapper.reset();
      shift_s = 0.0;
      T_shift = Pose2();
    } else {
      shift_s = ended_s + 0.02 - drive.odometry[next].stamp_s;
      T_shift = T_ended * drive.odometry[next].T_map_robot.inverse();
    }
    recording.begins.push_back(recording.frames.size());
    for (std::size_t i = s.first; i < s.last; ++i) {
      drive.profile(i, &profile);
      for (; next < drive.odometry.size() && drive.odometry[next].stamp_s <= profile.stamp_s + kOutAfter_s; ++next) {
        ended_s = drive.odometry[next].stamp_s + shift_s;
        T_ended = T_shift * drive.odometry[next].T_map_robot;
        mapper.add_odometry(ended_s, T_ended);
      }
      const Pose2 T_world_base = true_pose(drive, profile.stamp_s);
      profile.stamp_s += shift_s;
      const LocalMapperResult& result = mapper.update(profile, drive.T_base_camera);
      ++done;
      if (!result.accepted) continue;
      mapper.extract_scan_360(&scan);
      recording.add({result.stamp_s, result.T_local_base, result.T_odom_base, T_world_base, result.epoch}, scan);
      if (in_doubt) mapper.set_in_doubt(in_doubt(recording, recording.frames.size() - 1));
      if (done % 30 == 0) {
        stop_if_interrupted();
        progress.update(static_cast<double>(done) / static_cast<double>(all));
      }
    }
  }
  return recording;
}

ScanRecording record_plain_scans(const ProfileRecording& drive) {
  ScanRecording recording;
  recording.T_base_sensor = drive.T_base_camera;
  recording.begins.push_back(0);
  DepthProfile profile;
  RangeScan scan;
  for (std::size_t i = 0; i < drive.frames(); ++i) {
    drive.profile(i, &profile);
    Pose2 T_odom_base;
    if (!interpolate_at(drive.odometry, profile.stamp_s, 0.2, &T_odom_base)) continue;
    scan_from_profile(profile, DepthProfileConfig(), &scan);
    recording.add({profile.stamp_s, T_odom_base, T_odom_base, true_pose(drive, profile.stamp_s), 0}, scan);
  }
  return recording;
}

}  // namespace knav
