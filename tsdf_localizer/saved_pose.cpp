#include "tsdf_localizer/saved_pose.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"

namespace knav {

void save_pose(const std::string& path, const SavedPose& pose) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  std::error_code ignored;  // the write below says what is wrong
  if (!folder.empty()) std::filesystem::create_directories(folder, ignored);
  const Pose2& T = pose.T_map_base;
  const Eigen::Matrix3d& c = pose.covariance;
  write_text_atomically(
      path, fmt::format("# The last pose of kinect_nav's localizer; delete this file to forget it.\n"
                        "map_checksum: \"{}\"\npose_m_m_rad: [{:.6f}, {:.6f}, {:.6f}]\n"
                        "covariance_xx_xy_xa_yy_ya_aa: [{:.9g}, {:.9g}, {:.9g}, {:.9g}, {:.9g}, {:.9g}]\n",
                        pose.map_checksum, T.x_m, T.y_m, T.yaw_rad, c(0, 0), c(0, 1), c(0, 2), c(1, 1),
                        c(1, 2), c(2, 2)));
}

std::optional<SavedPose> load_saved_pose(const std::string& path) {
  if (path.empty() || !std::filesystem::exists(path)) return std::nullopt;
  const YAML::Node file = load_yaml_file(path);
  SavedPose pose;
  try {
    pose.map_checksum = file["map_checksum"].as<std::string>();
    const auto p = file["pose_m_m_rad"].as<std::vector<double>>();
    const auto c = file["covariance_xx_xy_xa_yy_ya_aa"].as<std::vector<double>>();
    pose.T_map_base = {p.at(0), p.at(1), p.at(2)};
    pose.covariance << c.at(0), c.at(1), c.at(2), c.at(1), c.at(3), c.at(4), c.at(2), c.at(4), c.at(5);
  } catch (const std::exception&) {
    throw UserError(path + ": not a saved pose; delete it.");
  }
  if (!is_finite(pose.T_map_base) || !pose.covariance.allFinite()) {
    throw UserError(path + ": the saved pose is not finite; delete it.");
  }
  return pose;
}

std::string checksum_of(const DistanceMap& map) {
  if (!map.checksum.empty()) return map.checksum;
  std::uint64_t hash = 1469598103934665603ull;  // FNV-1a, a word at a time
  const auto mix = [&hash](std::uint64_t word) { hash = (hash ^ word) * 1099511628211ull; };
  mix(static_cast<std::uint64_t>(map.geometry.width_cells));
  for (const double v : {map.geometry.resolution_m, map.geometry.origin_x_m, map.geometry.origin_y_m}) {
    std::uint64_t word;
    std::memcpy(&word, &v, sizeof word);
    mix(word);
  }
  for (const float v : map.distance_m) {
    std::uint32_t word;
    std::memcpy(&word, &v, sizeof word);
    mix(word);
  }
  return fmt::format("values-{:016x}", hash);
}

std::string saved_pose_path(const std::string& parameter) {
  if (parameter != "auto") return parameter;
  if (const char* ros_home = std::getenv("ROS_HOME"); ros_home && *ros_home) {
    return std::string(ros_home) + "/kinect_nav_pose.yaml";
  }
  const char* home = std::getenv("HOME");
  return home && *home ? std::string(home) + "/.ros/kinect_nav_pose.yaml" : "";
}

}  // namespace knav
