#include "kinect_calib/wall_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"
#include "kinect_calib/intrinsics_calibrator.h"

namespace knav {
namespace {

namespace fs = std::filesystem;

}  // namespace

std::vector<WallFrame> read_distances(const std::string& folder) {
  const std::string path = (fs::path(folder) / WallFolder::kDistances).string();
  std::istringstream text(read_text_file(path));
  std::vector<WallFrame> frames;
  std::string line;
  for (int number = 1; std::getline(text, line); ++number) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line[0] == '#') continue;
    const std::size_t comma = line.find(',');
    WallFrame frame;
    frame.file = line.substr(0, comma);
    char* end = nullptr;
    const std::string number_text = comma == std::string::npos ? "" : line.substr(comma + 1);
    frame.distance_m = std::strtod(number_text.c_str(), &end);
    if (number_text.empty() || end == number_text.c_str() || !(frame.distance_m > 0.0)) {
      if (number == 1) continue;  // a heading
      throw UserError(fmt::format("{}: line {}: expected `file,distance_m`.", path, number));
    }
    frames.push_back(frame);
  }
  if (frames.empty()) throw UserError(path + ": names no frames; write lines `file,distance_m`.");
  return frames;
}

RawCamera read_camera_info(const std::string& path) {
  const YAML::Node file = load_yaml_file(path);
  const auto data = [&](const char* key, std::size_t count) {
    std::vector<double> values;
    try {
      values = file[key]["data"].as<std::vector<double>>();
    } catch (const YAML::Exception&) {
      throw UserError(fmt::format("{}: '{}/data' is missing or no list of numbers.", path, key));
    }
    if (count > 0 && values.size() != count)
      throw UserError(fmt::format("{}: '{}' must have {} numbers.", path, key, count));
    return values;
  };
  RawCamera camera;
  try {
    camera.raw.width_px = file["image_width"].as<int>();
    camera.raw.height_px = file["image_height"].as<int>();
  } catch (const YAML::Exception&) {
    throw UserError(path + ": 'image_width' or 'image_height' is missing.");
  }
  const std::vector<double> K = data("camera_matrix", 9), P = data("projection_matrix", 12);
  camera.distortion = data("distortion_coefficients", 0);
  camera.rectified = camera.raw;
  camera.raw.fx_px = K[0], camera.raw.fy_px = K[4], camera.raw.cx_px = K[2], camera.raw.cy_px = K[5];
  camera.rectified.fx_px = P[0], camera.rectified.fy_px = P[5], camera.rectified.cx_px = P[2],
  camera.rectified.cy_px = P[6];
  return camera;
}

WallFolder::WallFolder(const std::string& path, bool resume) : path_(path) {
  std::error_code failed;
  fs::create_directories(path, failed);
  if (!fs::is_directory(path)) throw UserError(path + ": cannot be made a folder: " + failed.message() + ".");
  if (fs::exists(fs::path(path) / kDistances)) {
    if (!resume) {
      throw UserError(
          fmt::format("{}: holds distances already; go on with --resume, or name another folder.", path));
    }
    frames_ = read_distances(path);
  }
}

std::vector<double> WallFolder::distances_m() const {
  std::vector<double> distances_m;
  for (const WallFrame& frame : frames_) {
    if (distances_m.empty() || distances_m.back() != frame.distance_m)
      distances_m.push_back(frame.distance_m);
  }
  return distances_m;
}

void WallFolder::set_camera(const RawCamera& camera, const std::string& name) {
  const std::string path = (fs::path(path_) / kCamera).string();
  if (fs::exists(path)) {
    const PinholeModel there = read_camera_info(path).raw;
    if (there.width_px != camera.raw.width_px || there.height_px != camera.raw.height_px ||
        std::abs(there.fx_px - camera.raw.fx_px) > 0.01 * there.fx_px) {
      throw UserError(fmt::format(
          "{}: the folder's images are of another camera ({} x {} px, focal length {:.1f} px, not "
          "{} x {} and {:.1f}); name another folder.",
          path, there.width_px, there.height_px, there.fx_px, camera.raw.width_px, camera.raw.height_px,
          camera.raw.fx_px));
    }
    return;
  }
  RawCamera noted = camera;
  if (noted.distortion.empty()) noted.distortion.assign(5, 0.0);
  write_text_atomically(path, camera_info_text(noted, name));
}

void WallFolder::add(const std::vector<cv::Mat>& frames, double distance_m) {
  // As the file says it, so that it reads back as what was added.
  const double rounded_m = std::round(distance_m * 1e4) / 1e4;
  std::vector<WallFrame> all = frames_;
  const std::size_t number = distances_m().size() + 1;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    WallFrame frame{fmt::format("wall_{:02d}_{:02d}.png", number, i + 1), rounded_m};
    const std::string path = (fs::path(path_) / frame.file).string();
    write_file_atomically(path, [&](const std::string& beside) {
      bool written = false;
      try {
        written = cv::imwrite(beside, frames[i]);
      } catch (const cv::Exception&) {
      }
      if (!written) throw UserError(path + ": cannot be written; is the disk full, or the folder not yours?");
    });
    all.push_back(frame);
  }
  std::string text = "file,distance_m\n";
  for (const WallFrame& frame : all) text += fmt::format("{},{:.4f}\n", frame.file, frame.distance_m);
  write_text_atomically((fs::path(path_) / kDistances).string(), text);
  frames_ = std::move(all);
}

}  // namespace knav
