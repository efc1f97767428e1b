#include "global_map_builder/map_record.h"

#include <fmt/format.h>
#include <zlib.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <type_traits>

#include "core/error.h"
#include "core/file_io.h"

namespace knav {
namespace {

constexpr char kMagic[8] = {'k', 'n', 'a', 'v', 'd', 'r', 'v', 's'};
constexpr std::uint32_t kVersion = 1;
constexpr std::uint16_t kNone = 0xFFFF, kInfinite = 0xFFFE, kLargest = 0xFFFD;
constexpr double kFinest_m = 0.001;
constexpr std::uint64_t kMaxBytes = std::uint64_t{8} << 30;

/// The same walk over the data writes and reads it, so that the two cannot part.
class Writer {
 public:
  static constexpr bool kReading = false;
  template <class T>
  void plain(T& value) {
    static_assert(std::is_arithmetic_v<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

class Reader {
 public:
  static constexpr bool kReading = true;
  explicit Reader(const std::string& bytes) : bytes_(bytes) {}
  template <class T>
  void plain(T& value) {
    static_assert(std::is_arithmetic_v<T>);
    if (bytes_.size() - at_ < sizeof value) throw UserError("ends too early");
    std::memcpy(&value, bytes_.data() + at_, sizeof value);
    at_ += sizeof value;
  }
  std::size_t left() const { return bytes_.size() - at_; }

 private:
  const std::string& bytes_;
  std::size_t at_ = 0;
};

template <class Archive>
void size(Archive& a, std::size_t& count) {
  auto n = static_cast<std::uint32_t>(count);
  a.plain(n);
  if constexpr (Archive::kReading) {
    if (n > a.left()) throw UserError("holds an impossible count");  // every element takes a byte at least
    count = n;
  }
}

template <class Archive, class T, class Each>
void list(Archive& a, std::vector<T>& values, const Each& each) {
  std::size_t count = values.size();
  size(a, count);
  if constexpr (Archive::kReading) values.resize(count);
  for (T& value : values) each(value);
}

template <class Archive>
void text(Archive& a, std::string& value) {
  std::size_t count = value.size();
  size(a, count);
  if constexpr (Archive::kReading) value.resize(count);
  for (char& c : value) a.plain(c);
}

template <class Archive>
void flag(Archive& a, bool& value) {
  std::uint8_t byte = value ? 1 : 0;
  a.plain(byte);
  value = byte != 0;
}

template <class Archive>
void pose(Archive& a, Pose2& p) {
  a.plain(p.x_m);
  a.plain(p.y_m);
  a.plain(p.yaw_rad);
}

template <class Archive>
void matrix(Archive& a, Eigen::Matrix3d& m) {
  for (int i = 0; i < 9; ++i) a.plain(m.data()[i]);
}

template <class Archive>
void trajectory(Archive& a, Trajectory& t) {
  list(a, t, [&](StampedPose2& p) {
    a.plain(p.stamp_s);
    pose(a, p.T_map_robot);
  });
}

/// Lengths as multiples of a unit in 16 bits; NaN and infinity keep their own codes.
template <class Archive>
void lengths(Archive& a, std::vector<float>& values, double unit_m) {
  list(a, values, [&](float& v) {
    std::uint16_t code = kNone;
    if constexpr (!Archive::kReading) {
      if (std::isinf(v)) {
        code = kInfinite;
      } else if (!std::isnan(v)) {
        code =
            static_cast<std::uint16_t>(std::clamp(std::lround(v / unit_m), 0L, static_cast<long>(kLargest)));
      }
    }
    a.plain(code);
    if constexpr (Archive::kReading) {
      v = code == kNone       ? std::numeric_limits<float>::quiet_NaN()
          : code == kInfinite ? std::numeric_limits<float>::infinity()
                              : static_cast<float>(code * unit_m);
    }
  });
}

double unit_for(const std::vector<float>& values) {
  double unit_m = kFinest_m;
  for (const float v : values) {
    if (std::isfinite(v)) unit_m = std::max(unit_m, static_cast<double>(v) / kLargest);
  }
  return unit_m;
}

template <class Archive>
void profile(Archive& a, DepthProfile& p) {
  a.plain(p.stamp_s);
  a.plain(p.fx_px);
  a.plain(p.cx_px);
  a.plain(p.camera_height_m);
  a.plain(p.range_max_m);
  double unit_m = std::max({unit_for(p.z_m), unit_for(p.free_from_m), unit_for(p.free_to_m)});
  a.plain(unit_m);
  lengths(a, p.z_m, unit_m);
  lengths(a, p.free_from_m, unit_m);
  lengths(a, p.free_to_m, unit_m);
  list(a, p.height_class, [&](HeightClass& h) {
    auto code = static_cast<std::uint8_t>(h == HeightClass::kBlind ? HeightClass::kNone : h);
    a.plain(code);
    h = static_cast<HeightClass>(code & 3);
  });
}

template <class Archive>
void scan(Archive& a, RangeScan& s) {
  a.plain(s.stamp_s);
  a.plain(s.angle_min_rad);
  a.plain(s.angle_increment_rad);
  a.plain(s.range_min_m);
  a.plain(s.range_max_m);
  double unit_m = unit_for(s.range_m);
  a.plain(unit_m);
  lengths(a, s.range_m, unit_m);
  lengths(a, s.evidence, 1.0 / 32768.0);
}

template <class Archive>
void frame(Archive& a, DriveFrame& f) {
  a.plain(f.stamp_s);
  a.plain(f.path_m);
  pose(a, f.T_drive_base);
  pose(a, f.T_odom_base);
  pose(a, f.T_base_sensor);
  bool is_scan = std::holds_alternative<RangeScan>(f.data);
  flag(a, is_scan);
  if constexpr (Archive::kReading) {
    if (is_scan) f.data = RangeScan{};
  }
  if (is_scan) {
    scan(a, std::get<RangeScan>(f.data));
  } else {
    profile(a, std::get<DepthProfile>(f.data));
  }
}

template <class Archive>
void drive(Archive& a, Drive& d) {
  text(a, d.name);
  a.plain(d.breaks);
  list(a, d.frames, [&](DriveFrame& f) { frame(a, f); });
  list(a, d.keyframes, [&](Keyframe& k) {
    a.plain(k.stamp_s);
    a.plain(k.path_m);
    pose(a, k.T_drive_base);
    pose(a, k.T_odom_base);
    flag(a, k.after_break);
    flag(a, k.marked);
  });
  list(a, d.edges, [&](PoseGraphEdge& e) {
    a.plain(e.from);
    a.plain(e.to);
    pose(a, e.T_from_to);
    matrix(a, e.information);
  });
  trajectory(a, d.trajectory);
  trajectory(a, d.odometry);
}

template <class Archive>
void closure(Archive& a, Closure& c) {
  a.plain(c.from);
  a.plain(c.to);
  text(a, c.source);
  text(a, c.verdict);
  flag(a, c.matched);
  flag(a, c.accepted);
  text(a, c.reason);
  a.plain(c.chi2);
  pose(a, c.match.T_from_to);
  matrix(a, c.match.information);
  for (double* v : {&c.match.score, &c.match.overlap, &c.match.agreement, &c.match.residual_m,
                    &c.match.surface_m, &c.match.rival}) {
    a.plain(*v);
  }
}

template <class Archive>
void record(Archive& a, MapRecord& r) {
  list(a, r.drives, [&](Drive& d) { drive(a, d); });
  list(a, r.T_map_keyframe, [&](Pose2& p) { pose(a, p); });
  list(a, r.closures, [&](Closure& c) { closure(a, c); });
}

void check(const MapRecord& r) {
  std::size_t keyframes = 0;
  for (const Drive& d : r.drives) {
    keyframes += d.keyframes.size();
    if (d.trajectory.size() != d.odometry.size() || d.edges.size() + 1 != d.keyframes.size()) {
      throw UserError("contradicts itself");
    }
  }
  const auto count = static_cast<int>(keyframes);
  if (keyframes != r.T_map_keyframe.size()) throw UserError("contradicts itself");
  for (const Closure& c : r.closures) {
    if (c.from < 0 || c.to < 0 || c.from >= count || c.to >= count) throw UserError("contradicts itself");
  }
}

}  // namespace

int MapRecord::drive_of(int keyframe) const {
  int drive = 0;
  for (const Drive& d : drives) {
    if (keyframe < static_cast<int>(d.keyframes.size())) break;
    keyframe -= static_cast<int>(d.keyframes.size());
    ++drive;
  }
  return drive;
}

const Keyframe& MapRecord::keyframe(int number) const {
  auto index = static_cast<std::size_t>(number);
  for (const Drive& d : drives) {
    if (index < d.keyframes.size()) return d.keyframes[index];
    index -= d.keyframes.size();
  }
  throw std::out_of_range("no such keyframe");
}

void write_map_record(const std::string& path, const MapRecord& given) {
  Writer writer;
  record(writer, const_cast<MapRecord&>(given));  // the writer only reads
  const std::string& bytes = writer.bytes();
  uLongf packed_size = compressBound(static_cast<uLong>(bytes.size()));
  std::string packed(packed_size, '\0');
  // Level 1: a third of the time of level 6 for a tenth more bytes.
  if (compress2(reinterpret_cast<Bytef*>(packed.data()), &packed_size,
                reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uLong>(bytes.size()), 1) != Z_OK) {
    throw UserError(path + ": cannot be compressed; is the memory full?");
  }
  packed.resize(packed_size);
  const std::uint64_t length = bytes.size();
  const auto sum =
      static_cast<std::uint32_t>(crc32_z(0, reinterpret_cast<const Bytef*>(packed.data()), packed.size()));
  std::string file(kMagic, sizeof kMagic);
  file.append(reinterpret_cast<const char*>(&kVersion), sizeof kVersion);
  file.append(reinterpret_cast<const char*>(&sum), sizeof sum);
  file.append(reinterpret_cast<const char*>(&length), sizeof length);
  file += packed;
  write_text_atomically(path, file);
}

MapRecord read_map_record(const std::string& path) {
  constexpr std::size_t kHeader = sizeof kMagic + 4 + 4 + 8;
  const std::string file = read_text_file(path);
  if (file.size() < kHeader || std::memcmp(file.data(), kMagic, sizeof kMagic) != 0) {
    throw UserError(path + ": is not the drives.bin of a map.");
  }
  std::uint32_t version = 0, sum = 0;
  std::uint64_t length = 0;
  std::memcpy(&version, file.data() + 8, 4);
  std::memcpy(&sum, file.data() + 12, 4);
  std::memcpy(&length, file.data() + 16, 8);
  if (version != kVersion) throw UserError(path + ": was written by another version of this program.");
  const auto* packed = reinterpret_cast<const Bytef*>(file.data() + kHeader);
  const std::size_t packed_size = file.size() - kHeader;
  const UserError damaged(path + ": is damaged (checksum); build the map anew from its recordings.");
  if (crc32_z(0, packed, packed_size) != sum || length > kMaxBytes) throw damaged;
  std::string bytes(length, '\0');
  uLongf size = static_cast<uLongf>(length);
  if (uncompress(reinterpret_cast<Bytef*>(bytes.data()), &size, packed, static_cast<uLong>(packed_size)) !=
          Z_OK ||
      size != length) {
    throw damaged;
  }
  MapRecord out;
  try {
    Reader reader(bytes);
    record(reader, out);
    check(out);
  } catch (const UserError& error) {
    throw UserError(path + ": " + error.what() + "; build the map anew from its recordings.");
  }
  return out;
}

}  // namespace knav
