#include "global_map_builder/map_directory.h"

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/occupancy_distance.h"
#include "global_map_builder/directory_swap.h"
#include "global_map_builder/map_image.h"

namespace fs = std::filesystem;

namespace knav {
namespace {

constexpr int kFormatVersion = 1;

/// 64-bit FNV-1a: enough to tell maps apart and to notice damage, not a defence against forgery.
class Hash {
 public:
  void add(const void* data, std::size_t bytes) {
    const auto* p = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < bytes; ++i) value_ = (value_ ^ p[i]) * 0x100000001B3ull;
  }
  std::string text() const { return fmt::format("{:016x}", value_); }

 private:
  std::uint64_t value_ = 0xCBF29CE484222325ull;
};

std::string file_hash(const fs::path& path) {
  const std::string bytes = read_text_file(path.string());
  Hash hash;
  hash.add(bytes.data(), bytes.size());
  return hash.text();
}

DistanceMap read_distance_tiff(const fs::path& path, const GridGeometry& geometry) {
  cv::Mat image;
  try {
    image = cv::imread(path.string(), cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
  }
  if (image.empty() || image.type() != CV_32FC1) {
    throw UserError(path.string() +
                    ": is not a readable TIFF of 32-bit floats; delete it to have it computed anew.");
  }
  if (image.cols != geometry.width_cells || image.rows != geometry.height_cells) {
    throw UserError(fmt::format("{}: is {} x {} cells, but the map is {} x {}.", path.string(), image.cols,
                                image.rows, geometry.width_cells, geometry.height_cells));
  }
  DistanceMap map;
  map.geometry = geometry;
  map.distance_m.resize(geometry.cell_count());
  for (int row = 0; row < image.rows; ++row) {
    std::memcpy(&map.distance_m[geometry.index(0, image.rows - 1 - row)], image.ptr<float>(row),
                sizeof(float) * static_cast<std::size_t>(image.cols));
  }
  return map;
}

void write_distance_tiff(const fs::path& path, const DistanceMap& map) {
  cv::Mat image(map.geometry.height_cells, map.geometry.width_cells, CV_32FC1);
  for (int row = 0; row < image.rows; ++row) {
    std::memcpy(image.ptr<float>(row), &map.distance_m[map.geometry.index(0, image.rows - 1 - row)],
                sizeof(float) * static_cast<std::size_t>(image.cols));
  }
  if (!cv::imwrite(path.string(), image))
    throw UserError(path.string() + ": cannot be written; is the disk full?");
}

OccupancyGrid read_keepout(const fs::path& path, MapImageMeta meta, const GridGeometry& geometry) {
  OccupancyGrid keepout;
  keepout.geometry = geometry;
  keepout.value.assign(geometry.cell_count(), 0);
  if (!fs::exists(path)) return keepout;
  meta.image = path.string();
  meta.mode = "trinary";
  meta.negate = false;
  const OccupancyGrid drawn = read_map_image(meta);
  if (drawn.geometry.width_cells != geometry.width_cells ||
      drawn.geometry.height_cells != geometry.height_cells) {
    throw UserError(path.string() + ": must have as many pixels as the map image.");
  }
  for (std::size_t i = 0; i < drawn.value.size(); ++i) keepout.value[i] = drawn.value[i] == 100 ? 100 : 0;
  return keepout;
}

std::map<std::string, Pose2> read_places(const fs::path& path) {
  std::map<std::string, Pose2> places;
  if (!fs::exists(path)) return places;
  const YAML::Node file = load_yaml_file(path.string());
  if (file.IsNull()) return places;
  if (!file.IsMap())
    throw UserError(path.string() + ": must be a map of names, each with x_m, y_m and yaw_rad.");
  for (const auto& entry : file) {
    const auto name = entry.first.as<std::string>();
    Pose2 pose;
    try {
      pose = {entry.second["x_m"].as<double>(), entry.second["y_m"].as<double>(),
              entry.second["yaw_rad"] ? entry.second["yaw_rad"].as<double>() : 0.0};
    } catch (const YAML::Exception&) {
      throw UserError(fmt::format("{}: place '{}' needs the numbers x_m and y_m (and may have yaw_rad).",
                                  path.string(), name));
    }
    if (!is_finite(pose)) throw UserError(fmt::format("{}: place '{}' is not finite.", path.string(), name));
    places[name] = pose;
  }
  return places;
}

void write_places(const fs::path& path, const std::map<std::string, Pose2>& places) {
  YAML::Node file(YAML::NodeType::Map);
  for (const auto& [name, pose] : places) {
    file[name]["x_m"] = pose.x_m;
    file[name]["y_m"] = pose.y_m;
    file[name]["yaw_rad"] = pose.yaw_rad;
  }
  YAML::Emitter text;
  text << file;
  write_text_atomically(path.string(),
                        std::string("# Named goals: NAME: {x_m: , y_m: , yaw_rad: }, in the frame map.\n") +
                            (places.empty() ? "" : text.c_str()) + "\n");
}

YAML::Node read_metadata(const fs::path& path) {
  if (!fs::exists(path)) return YAML::Node();
  YAML::Node file = load_yaml_file(path.string());
  if (!file.IsMap() || !file["version"]) throw UserError(path.string() + ": is not the metadata of a map.");
  if (file["version"].as<int>(0) > kFormatVersion) {
    throw UserError(path.string() + ": was written by a newer version of this program; update it.");
  }
  return file;
}

void write_metadata(const fs::path& folder, const MapDirectory& map, const std::string& checksum) {
  YAML::Node file;
  file["version"] = kFormatVersion;
  file["checksum"] = checksum;
  for (const char* name : {"map.pgm", "distance.tiff", "keepout.pgm", "places.yaml"}) {
    file["files"][name] = file_hash(folder / name);
  }
  for (const auto& [key, value] : map.about) file["about"][key] = value;
  YAML::Emitter text;
  text << file;
  write_text_atomically((folder / "metadata.yaml").string(), std::string(text.c_str()) + "\n");
}

bool edited(const fs::path& folder, const YAML::Node& metadata, const char* name) {
  if (!metadata || !metadata["files"] || !metadata["files"][name] || !fs::exists(folder / name)) return false;
  return metadata["files"][name].as<std::string>() != file_hash(folder / name);
}

void check_replaceable(const fs::path& directory, bool force) {
  if (!fs::exists(directory)) return;
  if (!fs::is_directory(directory)) throw UserError(directory.string() + ": exists and is not a directory.");
  if (fs::is_empty(directory)) return;
  const YAML::Node metadata = read_metadata(directory / "metadata.yaml");
  if (!metadata || metadata.IsNull()) {
    throw UserError(directory.string() +
                    ": exists and holds something other than a map; choose another directory.");
  }
  for (const char* name : {"keepout.pgm", "places.yaml"}) {
    if (!force && edited(directory, metadata, name)) {
      throw UserError(
          fmt::format("{}: {} was edited by hand and would be lost; choose another directory or force it.",
                      directory.string(), name));
    }
  }
}

}  // namespace

bool is_map_directory(const std::string& path) { return fs::is_regular_file(fs::path(path) / "map.yaml"); }

std::string map_checksum(const OccupancyGrid& occupancy, const DistanceMap& distance) {
  Hash hash;
  const GridGeometry& g = occupancy.geometry;
  const double numbers[] = {static_cast<double>(g.width_cells), static_cast<double>(g.height_cells),
                            g.resolution_m, g.origin_x_m, g.origin_y_m};
  hash.add(numbers, sizeof numbers);
  hash.add(occupancy.value.data(), occupancy.value.size());
  for (const float d : distance.distance_m) {
    // One bit pattern for all NaNs.
    const float value = std::isnan(d) ? std::numeric_limits<float>::quiet_NaN() : d;
    hash.add(&value, sizeof value);
  }
  return hash.text();
}

MapDirectory load_map(const std::string& path) {
  const fs::path given(path);
  if (!fs::exists(given))
    throw UserError(path + ": no such map; give a directory written by build_map or a map.yaml.");
  const fs::path yaml = fs::is_directory(given) ? given / "map.yaml" : given;
  if (!fs::is_regular_file(yaml)) throw UserError(yaml.string() + ": no such file; is this a map directory?");
  const fs::path folder = yaml.parent_path();

  MapDirectory map;
  const MapImageMeta meta = read_map_yaml(yaml.string());
  map.occupancy = read_map_image(meta);
  // Files beside a plain map_server map belong to it only if they are a map directory's.
  const YAML::Node metadata = read_metadata(folder / "metadata.yaml");
  const bool ours = metadata && !metadata.IsNull() && fs::path(meta.image).filename() == "map.pgm";
  const fs::path tiff = folder / "distance.tiff";
  const bool redrawn = ours && edited(folder, metadata, "map.pgm");
  if (redrawn) {
    map.warnings.push_back(
        (folder / "map.pgm").string() +
        ": was edited since the map was built; distances are taken from it, not from distance.tiff.");
  }
  if (ours && fs::exists(tiff) && !redrawn) {
    map.distance = read_distance_tiff(tiff, map.occupancy.geometry);
    if (edited(folder, metadata, "distance.tiff")) {
      map.warnings.push_back(tiff.string() + ": differs from what build_map wrote (checksum).");
    }
  } else {
    map.distance = distance_from_occupancy(map.occupancy);
  }
  map.keepout = read_keepout(ours ? folder / "keepout.pgm" : fs::path(), meta, map.occupancy.geometry);
  if (ours) {
    map.places = read_places(folder / "places.yaml");
    if (fs::exists(folder / "trajectory.tum"))
      map.trajectory = read_trajectory((folder / "trajectory.tum").string());
    for (const auto& entry : metadata["about"])
      map.about[entry.first.as<std::string>()] = entry.second.as<std::string>();
  }
  map.checksum = map_checksum(map.occupancy, map.distance);
  map.distance.checksum = map.checksum;
  if (ours && map.warnings.empty() && metadata["checksum"].as<std::string>("") != map.checksum) {
    map.warnings.push_back(yaml.string() + ": resolution or origin were edited since the map was built.");
  }
  return map;
}

std::string save_map(const std::string& directory, const MapDirectory& map, bool force,
                     const std::function<void(const std::string&)>& more) {
  const GridGeometry& geometry = map.occupancy.geometry;
  if (geometry.cell_count() == 0) throw UserError(directory + ": the map is empty; nothing was written.");
  check_replaceable(directory, force);
  const std::string checksum = map_checksum(map.occupancy, map.distance);
  replace_directory(directory, [&](const std::string& beside) {
    const fs::path folder(beside);
    MapImageMeta meta;
    meta.image = "map.pgm";
    meta.resolution_m = geometry.resolution_m;
    meta.origin_x_m = geometry.origin_x_m;
    meta.origin_y_m = geometry.origin_y_m;
    write_map_yaml((folder / "map.yaml").string(), meta);
    write_map_image((folder / "map.pgm").string(), map.occupancy);
    write_distance_tiff(folder / "distance.tiff", map.distance);
    OccupancyGrid keepout = map.keepout;
    if (keepout.value.empty()) {
      keepout.geometry = geometry;
      keepout.value.assign(geometry.cell_count(), 0);
    }
    write_map_image((folder / "keepout.pgm").string(), keepout);
    write_places(folder / "places.yaml", map.places);
    if (!map.trajectory.empty()) write_trajectory((folder / "trajectory.tum").string(), map.trajectory);
    if (more) more(beside);
    write_metadata(folder, map, checksum);
  });
  return checksum;
}

}  // namespace knav
