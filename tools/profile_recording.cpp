#include "tools/profile_recording.h"

#include <cmath>
#include <fstream>
#include <limits>

#include "core/error.h"
#include "core/file_io.h"
#include "tools/binary_io.h"

namespace knav {
namespace {

constexpr char kMagic[8] = {'k', 'n', 'a', 'v', 'p', 'r', 'o', '2'};
constexpr float kStep_m = 0.0005f;
constexpr std::uint16_t kNothing = 65535;  ///< NaN of a profile, +Inf of a scan
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

std::uint16_t packed(float metres) {
  if (!(metres >= 0.0f)) return kNothing;
  const float steps = std::round(metres / kStep_m);
  return steps < static_cast<float>(kNothing) ? static_cast<std::uint16_t>(steps) : kNothing;
}
float unpacked(std::uint16_t steps) { return steps == kNothing ? kNaN : static_cast<float>(steps) * kStep_m; }

}  // namespace

void ProfileRecording::add(const DepthProfile& profile) {
  if (stamp_s_.empty()) {
    fx_px_ = profile.fx_px;
    cx_px_ = profile.cx_px;
    camera_height_m_ = profile.camera_height_m;
    range_max_m_ = profile.range_max_m;
    columns_ = profile.z_m.size();
  }
  if (profile.z_m.size() != columns_) throw UserError("the profiles of a recording must have one width.");
  stamp_s_.push_back(profile.stamp_s);
  for (std::size_t u = 0; u < columns_; ++u) {
    z_.push_back(packed(profile.z_m[u]));
    free_from_.push_back(packed(profile.free_from_m[u]));
    free_to_.push_back(packed(profile.free_to_m[u]));
    height_class_.push_back(static_cast<std::uint8_t>(profile.height_class[u]));
    rows_.push_back(u < profile.rows.size() ? profile.rows[u] : 255);
  }
}

void ProfileRecording::add_perfect_scan(std::size_t frame, const std::vector<float>& range_m) {
  PerfectScan scan;
  scan.frame = frame;
  for (const float range : range_m) scan.range.push_back(packed(range));
  perfect_scans.push_back(std::move(scan));
}

void ProfileRecording::profile(std::size_t i, DepthProfile* profile) const {
  profile->stamp_s = stamp_s_[i];
  profile->fx_px = fx_px_;
  profile->cx_px = cx_px_;
  profile->camera_height_m = camera_height_m_;
  profile->range_max_m = range_max_m_;
  profile->z_m.resize(columns_);
  profile->free_from_m.resize(columns_);
  profile->free_to_m.resize(columns_);
  profile->height_class.resize(columns_);
  profile->rows.resize(columns_);
  for (std::size_t u = 0, k = i * columns_; u < columns_; ++u, ++k) {
    profile->z_m[u] = unpacked(z_[k]);
    profile->free_from_m[u] = unpacked(free_from_[k]);
    profile->free_to_m[u] = unpacked(free_to_[k]);
    profile->height_class[u] = static_cast<HeightClass>(height_class_[k]);
    profile->rows[u] = rows_[k];
  }
}

void ProfileRecording::perfect_scan(const PerfectScan& scan, RangeScan* out) {
  out->angle_min_rad = -kPi;
  out->angle_increment_rad = 2.0 * kPi / static_cast<double>(scan.range.size());
  out->range_min_m = 0.0;
  out->range_max_m = 32.0;
  out->range_m.resize(scan.range.size());
  for (std::size_t i = 0; i < scan.range.size(); ++i) {
    out->range_m[i] =
        scan.range[i] == kNothing ? std::numeric_limits<float>::infinity() : unpacked(scan.range[i]);
  }
}

void ProfileRecording::save(const std::string& path) const {
  write_file_atomically(path, [&](const std::string& part) {
    std::ofstream out(part, std::ios::binary);
    write(out, kMagic);
    for (const double value : {fx_px_, cx_px_, camera_height_m_, range_max_m_}) write(out, value);
    write(out, columns_);
    write(out, T_base_camera);
    write(out, odometry);
    write(out, truth);
    write(out, stamp_s_);
    write(out, z_);
    write(out, free_from_);
    write(out, free_to_);
    write(out, height_class_);
    write(out, rows_);
    write(out, static_cast<std::uint64_t>(perfect_scans.size()));
    for (const PerfectScan& scan : perfect_scans) {
      write(out, static_cast<std::uint64_t>(scan.frame));
      write(out, scan.range);
    }
    out.close();
    if (!out) throw UserError(path + ": cannot be written; is the disk full?");
  });
}

ProfileRecording ProfileRecording::load(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw UserError(path + ": cannot be opened.");
  char magic[8] = {};
  read(in, &magic);
  if (!std::equal(magic, magic + 8, kMagic)) throw UserError(path + ": is no profile recording; delete it.");
  ProfileRecording r;
  for (double* value : {&r.fx_px_, &r.cx_px_, &r.camera_height_m_, &r.range_max_m_}) read(in, value);
  read(in, &r.columns_);
  read(in, &r.T_base_camera);
  read(in, &r.odometry);
  read(in, &r.truth);
  read(in, &r.stamp_s_);
  read(in, &r.z_);
  read(in, &r.free_from_);
  read(in, &r.free_to_);
  read(in, &r.height_class_);
  read(in, &r.rows_);
  std::uint64_t scans = 0;
  read(in, &scans);
  for (std::uint64_t i = 0; in && i < scans; ++i) {
    PerfectScan scan;
    std::uint64_t frame = 0;
    read(in, &frame);
    scan.frame = frame;
    read(in, &scan.range);
    r.perfect_scans.push_back(std::move(scan));
  }
  const std::size_t values = r.stamp_s_.size() * r.columns_;
  if (!in || r.z_.size() != values || r.height_class_.size() != values || r.rows_.size() != values || r.free_from_.size() != values ||
      r.free_to_.size() != values) {
    throw UserError(path + ": is cut short or damaged; delete it, and it will be made again.");
  }
  return r;
}

}  // namespace knav
