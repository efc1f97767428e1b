#include "core/trajectory.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "core/error.h"
#include "core/file_io.h"

namespace knav {

Trajectory read_trajectory(const std::string& path) {
  Trajectory trajectory;
  std::istringstream lines(read_text_file(path));
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    const auto start = line.find_first_not_of(" \t\r");
    if (start == std::string::npos || line[start] == '#') continue;
    std::istringstream fields(line);
    std::vector<double> value;
    for (double field; fields >> field;) value.push_back(field);
    if (!fields.eof() || (value.size() != 8 && value.size() != 4)) {
      throw UserError(fmt::format("{}: line {}: expected 't x y z qx qy qz qw' or 't x y theta'.", path, number));
    }
    StampedPose2 pose{value[0], {value[1], value[2], 0.0}};
    pose.T_map_robot.yaw_rad =
        value.size() == 4 ? normalize_angle_rad(value[3])
                          : std::atan2(2.0 * (value[7] * value[6] + value[4] * value[5]),
                                       1.0 - 2.0 * (value[5] * value[5] + value[6] * value[6]));
    if (!std::isfinite(pose.stamp_s) || !is_finite(pose.T_map_robot)) {
      throw UserError(fmt::format("{}: line {}: not a finite pose.", path, number));
    }
    trajectory.push_back(pose);
  }
  std::stable_sort(trajectory.begin(), trajectory.end(),
                   [](const StampedPose2& a, const StampedPose2& b) { return a.stamp_s < b.stamp_s; });
  return trajectory;
}

void write_trajectory(const std::string& path, const Trajectory& trajectory) {
  std::string text = "# t x y z qx qy qz qw [s, m]\n";
  for (const auto& [stamp_s, T] : trajectory) {
    text += fmt::format("{:.6f} {:.6f} {:.6f} 0 0 0 {:.9f} {:.9f}\n", stamp_s, T.x_m, T.y_m, std::sin(T.yaw_rad / 2),
                        std::cos(T.yaw_rad / 2));
  }
  write_text_atomically(path, text);
}

bool interpolate_at(const Trajectory& trajectory, double stamp_s, double max_gap_s, Pose2* T_map_robot) {
  const auto after = std::lower_bound(trajectory.begin(), trajectory.end(), stamp_s,
                                      [](const StampedPose2& pose, double stamp) { return pose.stamp_s < stamp; });
  if (after == trajectory.end()) return false;
  if (after->stamp_s == stamp_s) {
    *T_map_robot = after->T_map_robot;
    return true;
  }
  if (after == trajectory.begin()) return false;
  const auto before = after - 1;
  const double gap_s = after->stamp_s - before->stamp_s;
  if (gap_s > max_gap_s) return false;
  *T_map_robot = interpolate(before->T_map_robot, after->T_map_robot, (stamp_s - before->stamp_s) / gap_s);
  return true;
}

}  // namespace knav
