#include "kinect_calib/depth_calibration_run.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/file_io.h"
#include "core/progress.h"
#include "kinect_calib/calibration_report.h"
#include "kinect_calib/depth_calibrator.h"
#include "ros_common/program.h"

namespace knav {
namespace {

namespace fs = std::filesystem;

nlohmann::json as_json(const std::vector<WallScore>& scores) {
  nlohmann::json list = nlohmann::json::array();
  for (const WallScore& s : scores) {
    list.push_back({{"distance_m", s.distance_m},
                    {"frames", s.frames},
                    {"mean_bias_before", s.mean_bias_before},
                    {"mean_bias_after", s.mean_bias_after},
                    {"mean_bias_after_offset", s.mean_bias_after_offset},
                    {"mean_bias_after_paper", s.mean_bias_after_paper},
                    {"tile_bias_p95_before", s.tile_bias_p95_before},
                    {"tile_bias_p95_after", s.tile_bias_p95_after},
                    {"tile_bias_p95_after_offset", s.tile_bias_p95_after_offset},
                    {"tile_bias_p95_after_paper", s.tile_bias_p95_after_paper}});
  }
  return list;
}

std::string as_table(const std::string& title, const std::vector<WallScore>& scores) {
  std::string text = fmt::format(
      "{}: bias in per cent of the distance\n"
      "                       frame-wide mean                  95th percentile of tiles\n"
      "distance_m  frames   before   after  offset   paper     before   after  offset   paper\n",
      title);
  for (const WallScore& s : scores) {
    text += fmt::format("{:10.3f}  {:6d} {:8.2f} {:7.2f} {:7.2f} {:7.2f}   {:8.2f} {:7.2f} {:7.2f} {:7.2f}\n",
                        s.distance_m, s.frames, 100 * s.mean_bias_before, 100 * s.mean_bias_after,
                        100 * s.mean_bias_after_offset, 100 * s.mean_bias_after_paper,
                        100 * s.tile_bias_p95_before, 100 * s.tile_bias_p95_after,
                        100 * s.tile_bias_p95_after_offset, 100 * s.tile_bias_p95_after_paper);
  }
  return text;
}

constexpr int kComparedTiles_px[] = {1, 2, 4, 8, 16, 32, 64};  // as the paper did

}  // namespace

void add_fit_options(CLI::App* app, DepthCalibrationOptions* options) {
  app->add_option("--out", options->out, "calibration to write (YAML)")->required();
  app->add_option("--validate", options->validate,
                  "folder or bag not used in fitting, to score the result on");
  app->add_option("--device", options->device, "serial number or name to note in the file");
  app->add_option("--tile", options->tile_px, "side of a tile [px]")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  app->add_flag("--keep-bands", options->keep_bands, "do not remove vertical bands from each frame");
  app->add_flag("--square", options->square, "the sensor stood exactly square to the wall: fit no tilt");
  app->add_flag("--compare-tiles", options->compare_tiles,
                "also calibrate with tiles of 1 to 64 px, and compare");
  app->add_option("--report", options->report, "write a page (.html) or the table (any other) to this file");
  app->add_option("--json", options->json, "write the figures to this file; '-' for standard output");
}

void run_depth_calibration(const DepthCalibrationOptions& options) {
  DepthCalibratorConfig config;
  config.tile_px = options.tile_px;
  config.deband = !options.keep_bands;
  config.fit_wall_tilt = !options.square;
  DepthCalibrator training(config);
  std::vector<std::unique_ptr<DepthCalibrator>> others;
  std::vector<DepthCalibrator*> all = {&training};
  if (options.compare_tiles) {
    for (const int tile_px : kComparedTiles_px) {
      DepthCalibratorConfig other = config;
      other.tile_px = tile_px;
      others.push_back(std::make_unique<DepthCalibrator>(other));
      all.push_back(others.back().get());
    }
  }
  WallLoader loader(options.topics, options.camera_info);
  loader.load(options.input, "reading walls", all);
  DepthCalibration calibration = training.fit();
  calibration.device = options.device;

  std::string report = fmt::format(
      "Depth calibration of '{}': {} distances, {:.2f} to {:.2f} m; {} of {} tiles filled from neighbours, "
      "{} of "
      "them because no smooth error explains them; {} quadratics held from bending back\n\n",
      options.device, training.distances(), calibration.trained_min_m, calibration.trained_max_m,
      training.filled_tiles(), calibration.tile_count(), training.wild_tiles(), training.held_quadratics());
  const std::vector<WallScore> trained = training.score(calibration);
  report += as_table("Training", trained);
  nlohmann::json json = {{"device", options.device},
                         {"tile_px", calibration.tile_px},
                         {"filled_tiles", training.filled_tiles()},
                         {"wild_tiles", training.wild_tiles()},
                         {"held_quadratics", training.held_quadratics()},
                         {"inverse_depth_scale", calibration.inverse_depth_scale},
                         {"training", as_json(trained)},
                         {"validation", nlohmann::json::array()}};
  config.tile_px = WallTiles::kGateTile_px;
  config.deband = false;  // at run time nobody removes bands
  DepthCalibrator validation(config);
  if (!options.validate.empty()) {
    loader.load(options.validate, "validating", {&validation});
    const std::vector<WallScore> validated = validation.score(calibration);
    report += "\n" + as_table("Validation", validated);
    json["validation"] = as_json(validated);
  }
  if (options.compare_tiles) {
    Progress progress("comparing tile sizes");
    for (std::size_t i = 0; i < others.size(); ++i) {
      stop_if_interrupted();
      progress.update(static_cast<double>(i) / static_cast<double>(others.size()),
                      fmt::format("{} px", kComparedTiles_px[i]));
      const DepthCalibration other = others[i]->fit();
      json["tiles"].push_back({{"tile_px", kComparedTiles_px[i]},
                               {"training", as_json(others[i]->score(other))},
                               {"validation", as_json(validation.score(other))}});
    }
  }
  save_depth_calibration(options.out, calibration);
  write_json(options.json, json.dump(2));
  if (fs::path(options.report).extension() == ".html") {
    write_calibration_report(options.report, calibration, training, validation, json);
  } else if (!options.report.empty()) {
    write_text_atomically(options.report, report);
  }
  if (options.json != "-")
    fmt::print("{}\nWritten to {}; give it to depth_correction as calibration_file.\n", report, options.out);
}

}  // namespace knav
