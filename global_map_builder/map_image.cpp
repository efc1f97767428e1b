#include "global_map_builder/map_image.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "core/config.h"
#include "core/error.h"

namespace knav {
namespace {

template <class T>
T required(const YAML::Node& file, const std::string& path, const char* key) {
  if (!file[key]) throw UserError(fmt::format("{}: key '{}' is missing.", path, key));
  try {
    return file[key].as<T>();
  } catch (const YAML::Exception&) {
    throw UserError(fmt::format("{}: key '{}' has a value of the wrong kind.", path, key));
  }
}

void check(bool good, const std::string& path, const char* key, const char* rule) {
  if (!good) throw UserError(fmt::format("{}: '{}' {}.", path, key, rule));
}

/// The decoders of OpenCV fill up a short file with garbage, so a PGM's size is checked here.
void check_pgm_size(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string magic;
  file >> magic;
  if (magic != "P5") return;
  long long numbers[3] = {};
  for (long long& number : numbers) {
    while ((file >> std::ws).peek() == '#') file.ignore(1 << 16, '\n');
    if (!(file >> number) || number <= 0) throw UserError(path + ": its PGM header is malformed.");
  }
  file.get();
  const long long needed = numbers[0] * numbers[1] * (numbers[2] > 255 ? 2 : 1);
  const auto start = static_cast<long long>(file.tellg());
  const auto size = static_cast<long long>(std::filesystem::file_size(path));
  if (size - start < needed) {
    throw UserError(fmt::format("{}: is cut off; {} x {} pixels need {} bytes more.", path, numbers[0],
                                numbers[1], needed - (size - start)));
  }
}

/// map_server's rule for one pixel.
std::int8_t occupancy_of(double gray, double alpha, const MapImageMeta& meta) {
  if (meta.negate) gray = 255.0 - gray;
  if (meta.mode == "raw") {
    const auto value = static_cast<int>(gray);
    return static_cast<std::int8_t>(value <= 100 ? value : -1);
  }
  const double occupied = (255.0 - gray) / 255.0;
  if (occupied > meta.occupied_thresh) return 100;
  if (occupied < meta.free_thresh) return 0;
  if (meta.mode == "trinary" || alpha < 1.0) return -1;
  const double ratio = (occupied - meta.free_thresh) / (meta.occupied_thresh - meta.free_thresh);
  return static_cast<std::int8_t>(1.0 + 98.0 * ratio);
}

}  // namespace

MapImageMeta read_map_yaml(const std::string& path) {
  const YAML::Node file = load_yaml_file(path);
  if (!file.IsMap())
    throw UserError(path + ": is not a map_server YAML file (keys image, resolution, origin, ...).");
  MapImageMeta meta;
  const std::filesystem::path image = required<std::string>(file, path, "image");
  meta.image = (image.is_absolute() ? image : std::filesystem::path(path).parent_path() / image).string();
  meta.resolution_m = required<double>(file, path, "resolution");
  check(std::isfinite(meta.resolution_m) && meta.resolution_m > 0.0, path, "resolution",
        "must be metres above 0");
  const auto origin = required<std::vector<double>>(file, path, "origin");
  check(origin.size() >= 2 && std::isfinite(origin[0]) && std::isfinite(origin[1]), path, "origin",
        "must be [x, y, yaw] in metres and radians");
  check(origin.size() < 3 || origin[2] == 0.0, path, "origin", "has a yaw; rotated maps are not supported");
  meta.origin_x_m = origin[0];
  meta.origin_y_m = origin[1];
  if (file["mode"]) meta.mode = required<std::string>(file, path, "mode");
  check(meta.mode == "trinary" || meta.mode == "scale" || meta.mode == "raw", path, "mode",
        "must be trinary, scale or raw");
  if (file["negate"]) {
    const auto text = required<std::string>(file, path, "negate");
    check(text == "0" || text == "1" || text == "true" || text == "false", path, "negate", "must be 0 or 1");
    meta.negate = text == "1" || text == "true";
  }
  if (file["occupied_thresh"]) meta.occupied_thresh = required<double>(file, path, "occupied_thresh");
  if (file["free_thresh"]) meta.free_thresh = required<double>(file, path, "free_thresh");
  check(meta.free_thresh <= meta.occupied_thresh, path, "free_thresh", "must not be above occupied_thresh");
  return meta;
}

void write_map_yaml(const std::string& path, const MapImageMeta& meta) {
  std::ofstream file(path);
  file << fmt::format(
      "image: {}\nmode: {}\nresolution: {}\norigin: [{}, {}, 0.0]\nnegate: {}\noccupied_thresh: {}\n"
      "free_thresh: {}\n",
      meta.image, meta.mode, meta.resolution_m, meta.origin_x_m, meta.origin_y_m, meta.negate ? 1 : 0,
      meta.occupied_thresh, meta.free_thresh);
  file.close();
  if (!file) throw UserError(path + ": cannot be written; is the disk full?");
}

OccupancyGrid read_map_image(const MapImageMeta& meta) {
  if (!std::filesystem::is_regular_file(meta.image)) throw UserError(meta.image + ": no such file.");
  check_pgm_size(meta.image);
  cv::Mat image;
  try {
    image = cv::imread(meta.image, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception& error) {
    throw UserError(fmt::format("{}: cannot be read as an image ({}).", meta.image, error.err));
  }
  if (image.empty()) throw UserError(meta.image + ": is not a readable image.");
  if (image.depth() == CV_16U) image.convertTo(image, CV_8U, 1.0 / 257.0);
  if (image.depth() != CV_8U) throw UserError(meta.image + ": must have 8 or 16 bits per channel.");

  OccupancyGrid grid;
  grid.geometry = {image.cols, image.rows, meta.resolution_m, meta.origin_x_m, meta.origin_y_m};
  grid.value.resize(grid.geometry.cell_count());
  const int channels = image.channels();
  const bool has_alpha = channels == 2 || channels == 4;
  const int colors = has_alpha && meta.mode != "trinary" ? channels - 1 : channels;
  for (int row = 0; row < image.rows; ++row) {
    const std::uint8_t* pixel = image.ptr<std::uint8_t>(row);
    for (int column = 0; column < image.cols; ++column, pixel += channels) {
      double sum = 0.0;
      for (int k = 0; k < colors; ++k) sum += pixel[k];
      const double alpha =
          channels == 1 ? 1.0 : pixel[channels - 1];  // 0 ... 255, compared with 1 as map_server does
      grid.value[grid.geometry.index(column, image.rows - 1 - row)] = occupancy_of(sum / colors, alpha, meta);
    }
  }
  return grid;
}

void write_map_image(const std::string& path, const OccupancyGrid& grid) {
  cv::Mat image(grid.geometry.height_cells, grid.geometry.width_cells, CV_8U);
  for (int row = 0; row < image.rows; ++row) {
    for (int column = 0; column < image.cols; ++column) {
      const std::int8_t value = grid.value[grid.geometry.index(column, image.rows - 1 - row)];
      image.at<std::uint8_t>(row, column) = value == 0 ? 254 : value == 100 ? 0 : 205;
    }
  }
  if (!cv::imwrite(path, image)) throw UserError(path + ": cannot be written; is the disk full?");
}

}  // namespace knav
