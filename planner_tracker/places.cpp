#include "planner_tracker/places.h"

#include <fmt/format.h>

#include <filesystem>

#include "core/config.h"

namespace knav {

std::map<std::string, Pose2> load_places(const std::string& path) {
  namespace fs = std::filesystem;
  std::string file = path;
  if (fs::is_directory(path))
    file = (fs::path(path) / "places.yaml").string();
  else if (fs::path(path).filename() == "map.yaml")
    file = (fs::path(path).parent_path() / "places.yaml").string();
  const YAML::Node root = load_yaml_file(file);
  std::map<std::string, Pose2> places;
  if (root.IsNull()) return places;
  if (!root.IsMap()) throw UserError(file + ": must be a map of places, NAME: {x_m: , y_m: , yaw_rad: }.");
  for (const auto& entry : root) {
    const auto name = entry.first.as<std::string>();
    try {
      const Pose2 pose{entry.second["x_m"].as<double>(), entry.second["y_m"].as<double>(),
                       entry.second["yaw_rad"] ? entry.second["yaw_rad"].as<double>() : 0.0};
      if (!is_finite(pose)) throw UserError("");
      places[name] = pose;
    } catch (const std::exception&) {
      throw UserError(fmt::format("{}: place '{}' must have the numbers x_m, y_m and yaw_rad.", file, name));
    }
  }
  return places;
}

}  // namespace knav
