// score_walls: leave-one-out over raw disparity frames of flat walls -> how flat each correction makes them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/progress.h"
#include "kinect_calib/wall_leave_one_out.h"
#include "ros_common/command_line.h"

namespace knav {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string folder, published, json;
  std::vector<double> disparity, intrinsics;
  std::vector<int> tiles_px = {16};
  bool keep_bands = false;
};

const std::vector<std::string> kModels = {"default", "offset", "paper"};

const char* const kHelp =
    R"(FOLDER holds one PNG a wall, 16 bit, a Kinect v1's raw disparity (2047 invalid). Each wall in turn is left out:
the others, at the distances of their own planes, calibrate, and a plane is fitted to the one left out, corrected.
Bands are not removed from the wall that is scored. The JSON holds per tile size and wall distance_m, and for raw,
published (the model given) and each model residual_rms_codes and residual_rms_m (off the plane) and scale_error
(relative); in `all`, the rms over walls, its ratio to the published one's, and the largest scale error.)";

nlohmann::json as_json(const WallFlatness& flatness, double distance_m) {
  return {{"residual_rms_codes", flatness.residual_rms_codes},
          {"residual_rms_m", flatness.residual_rms_m},
          {"scale_error", flatness.distance_m / distance_m - 1.0}};
}

struct Total {
  double squares = 0.0, scale_error = 0.0;
  int walls = 0;
  void add(const WallFlatness& flatness, double distance_m) {
    squares += flatness.residual_rms_codes * flatness.residual_rms_codes;
    scale_error = std::max(scale_error, std::abs(flatness.distance_m / distance_m - 1.0));
    ++walls;
  }
  double rms() const { return std::sqrt(squares / walls); }
};

void score(const Options& options) {
  std::vector<std::string> paths;
  if (!fs::is_directory(options.folder)) throw UserError(options.folder + ": is no folder.");
  for (const auto& entry : fs::directory_iterator(options.folder)) {
    if (entry.path().extension() == ".png") paths.push_back(entry.path().string());
  }
  std::sort(paths.begin(), paths.end());
  if (paths.size() < 4)
    throw UserError(
        fmt::format("{}: {} PNG files; at least 4 walls are needed.", options.folder, paths.size()));
  std::vector<cv::Mat> disparities;
  for (const std::string& path : paths) {
    disparities.push_back(cv::imread(path, cv::IMREAD_UNCHANGED));
    if (disparities.back().type() != CV_16UC1)
      throw UserError(path + ": must be a PNG with one channel of 16 bits.");
  }
  DisparityCamera camera;
  camera.dc0_per_m = options.disparity[0];
  camera.dc1_per_m = options.disparity[1];
  camera.pinhole = {disparities[0].cols,   disparities[0].rows,   options.intrinsics[0],
                    options.intrinsics[1], options.intrinsics[2], options.intrinsics[3]};
  PixelDisparityModel published;
  const bool has_published = !options.published.empty();
  if (has_published) published = PixelDisparityModel::load(options.published);

  nlohmann::json json;
  Progress progress("leave one out");
  std::string text;
  for (std::size_t t = 0; t < options.tiles_px.size(); ++t) {
    stop_if_interrupted();
    progress.update(static_cast<double>(t) / static_cast<double>(options.tiles_px.size()),
                    fmt::format("tiles of {} px", options.tiles_px[t]));
    DepthCalibratorConfig config;
    config.tile_px = options.tiles_px[t];
    config.deband = !options.keep_bands;
    config.wall_tilt_sd = 0.05;  // a camera held or put down by hand
    const std::vector<LeaveOneOutWall> walls =
        leave_one_out(disparities, camera, has_published ? &published : nullptr, config, kModels);
    nlohmann::json list = nlohmann::json::array();
    Total raw, by_published;
    std::vector<Total> by_model(kModels.size());
    text += fmt::format(
        "tiles of {} px: rms off the plane [codes], scale error [%]\nwall        z[m]     raw  published",
        config.tile_px);
    for (const std::string& model : kModels) text += fmt::format("  {:>16}", model);
    for (std::size_t i = 0; i < walls.size(); ++i) {
      const double distance_m = walls[i].raw.distance_m;
      const std::string name = fs::path(paths[i]).filename().string();
      nlohmann::json entry = {
          {"file", name}, {"distance_m", distance_m}, {"raw", as_json(walls[i].raw, distance_m)}};
      raw.add(walls[i].raw, distance_m);
      text += fmt::format("\n{:10} {:5.3f}  {:6.3f}  {:9.3f}", name, distance_m,
                          walls[i].raw.residual_rms_codes, walls[i].published.residual_rms_codes);
      if (has_published) {
        by_published.add(walls[i].published, distance_m);
        entry["published"] = as_json(walls[i].published, distance_m);
      }
      for (std::size_t m = 0; m < kModels.size(); ++m) {
        by_model[m].add(walls[i].models[m], distance_m);
        entry[kModels[m]] = as_json(walls[i].models[m], distance_m);
        text += fmt::format("  {:7.3f} {:+7.3f}%", walls[i].models[m].residual_rms_codes,
                            100.0 * (walls[i].models[m].distance_m / distance_m - 1.0));
      }
      list.push_back(entry);
    }
    nlohmann::json all = {{"raw", {{"residual_rms_codes", raw.rms()}}}};
    text += fmt::format("\nall               {:6.3f}  {:9.3f}", raw.rms(),
                        has_published ? by_published.rms() : 0.0);
    if (has_published)
      all["published"] = {{"residual_rms_codes", by_published.rms()},
                          {"scale_error_max", by_published.scale_error}};
    for (std::size_t m = 0; m < kModels.size(); ++m) {
      all[kModels[m]] = {{"residual_rms_codes", by_model[m].rms()},
                         {"scale_error_max", by_model[m].scale_error}};
      if (has_published) all[kModels[m]]["ratio_to_published"] = by_model[m].rms() / by_published.rms();
      text += fmt::format("  {:7.3f} {:7.3f}%", by_model[m].rms(), 100.0 * by_model[m].scale_error);
    }
    text += "\n";
    if (has_published) {
      text += "ratio to published                ";
      for (const Total& total : by_model)
        text += fmt::format("  {:7.3f}         ", total.rms() / by_published.rms());
      text += "\n";
    }
    text += "\n";
    json["tiles"].push_back({{"tile_px", config.tile_px}, {"walls", list}, {"all", all}});
  }
  write_json(options.json, json.dump(2));
  if (options.json != "-") fmt::print("{}", text);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app("Scores depth corrections on real flat walls, leaving one out at a time.");
  knav::Options options;
  app.add_option("FOLDER", options.folder, "folder of raw disparity PNGs, one a wall")->required();
  app.add_option("--disparity", options.disparity, "dc0 dc1 [1/m]: 1/z = dc0 + dc1 d")
      ->expected(2)
      ->required();
  app.add_option("--intrinsics", options.intrinsics, "fx fy cx cy [px]")->expected(4)->required();
  app.add_option("--published", options.published,
                 "OpenCV file with dc_alpha, dc_beta: a per-pixel model to compare with");
  app.add_option("--tile", options.tiles_px, "sides of tiles [px] to try")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  app.add_flag("--keep-bands", options.keep_bands, "do not remove bands from the walls that calibrate");
  app.add_option("--json", options.json, "write the figures to this file; '-' for standard output");
  app.footer(knav::kHelp);
  return knav::run_command(app, argc, argv, [&] { knav::score(options); });
}
