#include "tools/carmen_log.h"

#include <fmt/format.h>

#include <charconv>
#include <sstream>
#include <string_view>

#include "core/error.h"
#include "core/file_io.h"

namespace knav {
namespace {

/// The fields of one line, read one after the other; any fault is thrown with the line's number.
class Fields {
 public:
  Fields(const std::string& path, int line_number, std::string_view line)
      : path_(path), line_number_(line_number), rest_(line) {}

  std::string_view word() {
    const auto start = rest_.find_first_not_of(" \t\r");
    if (start == std::string_view::npos) fail("the line ends too early");
    rest_.remove_prefix(start);
    const auto length = std::min(rest_.find_first_of(" \t\r"), rest_.size());
    const std::string_view field = rest_.substr(0, length);
    rest_.remove_prefix(length);
    return field;
  }

  double number() {
    const std::string_view field = word();
    double value = 0.0;
    const auto [end, fault] = std::from_chars(field.data(), field.data() + field.size(), value);
    if (fault != std::errc() || end != field.data() + field.size()) {
      fail(fmt::format("'{}' is not a number", field));
    }
    return value;
  }

  Pose2 pose() {
    const double x = number(), y = number(), yaw = number();
    return {x, y, normalize_angle_rad(yaw)};
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw UserError(fmt::format("{}: line {}: {}.", path_, line_number_, what));
  }

 private:
  const std::string& path_;
  int line_number_;
  std::string_view rest_;
};

}  // namespace

CarmenLog read_carmen_log(const std::string& path) {
  CarmenLog log;
  std::istringstream lines(read_text_file(path));
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    Fields fields(path, number, line);
    if (line.rfind("FLASER ", 0) == 0) {
      fields.word();
      const double count = fields.number();
      if (!(count >= 2 && count <= 100000)) fields.fail("FLASER has an impossible number of readings");
      CarmenScan scan;
      scan.range_m.resize(static_cast<std::size_t>(count));
      for (float& range : scan.range_m) range = static_cast<float>(fields.number());
      scan.T_odom_laser = fields.pose();
      scan.T_odom_robot = fields.pose();
      scan.stamp_s = fields.number();
      log.scans.push_back(std::move(scan));
    } else if (line.rfind("ODOM ", 0) == 0) {
      fields.word();
      CarmenOdometry odometry;
      odometry.T_odom_robot = fields.pose();
      for (int skipped = 0; skipped < 3; ++skipped) fields.number();
      odometry.stamp_s = fields.number();
      log.odometry.push_back(odometry);
    }
  }
  if (log.scans.empty()) throw UserError(path + ": no FLASER line; is this a CARMEN log?");
  return log;
}

}  // namespace knav
