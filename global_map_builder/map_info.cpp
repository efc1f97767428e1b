// map_info: what a map directory holds, and whether it is whole.
#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "global_map_builder/map_directory.h"
#include "global_map_builder/map_picture.h"
#include "ros_common/command_line.h"

namespace knav {
namespace {

void map_info(const std::string& path, const std::string& json, const std::string& picture) {
  const MapDirectory map = load_map(path);
  const GridGeometry& g = map.occupancy.geometry;
  std::size_t free = 0, occupied = 0, keepout = 0;
  for (const std::int8_t v : map.occupancy.value) {
    free += v >= 0 && v < 50;
    occupied += v >= 50;
  }
  for (const std::int8_t v : map.keepout.value) keepout += v == 100;
  const double cell_m2 = g.resolution_m * g.resolution_m;
  nlohmann::json out = {{"width_m", g.width_cells * g.resolution_m},
                        {"height_m", g.height_cells * g.resolution_m},
                        {"resolution_m", g.resolution_m},
                        {"origin_x_m", g.origin_x_m},
                        {"origin_y_m", g.origin_y_m},
                        {"free_m2", static_cast<double>(free) * cell_m2},
                        {"occupied_cells", occupied},
                        {"keepout_m2", static_cast<double>(keepout) * cell_m2},
                        {"trajectory_poses", map.trajectory.size()},
                        {"checksum", map.checksum},
                        {"warnings", map.warnings}};
  for (const auto& [name, pose] : map.places) {
    out["places"][name] = {{"x_m", pose.x_m}, {"y_m", pose.y_m}, {"yaw_rad", pose.yaw_rad}};
  }
  for (const auto& [key, value] : map.about) out["about"][key] = value;
  write_json(json, out.dump(2));
  if (!picture.empty()) write_map_picture(picture, map);
  if (json != "-") {
    fmt::print("{}: {:.2f} x {:.2f} m at {} m, origin ({:.3f}, {:.3f})\n", path,
               g.width_cells * g.resolution_m, g.height_cells * g.resolution_m, g.resolution_m, g.origin_x_m,
               g.origin_y_m);
    fmt::print("free {:.1f} m2, {} occupied cells, keepout {:.1f} m2, {} places, {} trajectory poses\n",
               static_cast<double>(free) * cell_m2, occupied, static_cast<double>(keepout) * cell_m2,
               map.places.size(), map.trajectory.size());
    for (const auto& [key, value] : map.about) fmt::print("{}: {}\n", key, value);
    fmt::print("checksum {}: {}\n", map.checksum,
               map.warnings.empty() ? "whole" : "changed since it was built");
  }
  for (const std::string& warning : map.warnings) fmt::print(stderr, "map_info: {}\n", warning);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(
      "Prints and verifies a map directory, or a map_server map by its YAML file. Exit code 1 if it cannot "
      "be used.");
  std::string path, json, picture;
  app.add_option("MAP", path, "map directory or map.yaml")->required();
  app.add_option(
      "--json", json,
      "write {width_m, height_m, resolution_m, origin_x_m, origin_y_m, free_m2, occupied_cells, keepout_m2, "
      "trajectory_poses, places, about, checksum, warnings} here; '-' = standard output");
  app.add_option("--picture", picture, "PNG to write");
  return knav::run_command(app, argc, argv, [&] { knav::map_info(path, json, picture); });
}
