#include "kinect_calib/calibration_report.h"

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "core/error.h"
#include "core/file_io.h"
#include "kinect_calib/depth_corrector.h"

extern char** environ;

namespace knav {
namespace {

namespace fs = std::filesystem;

/// JSON knows no NaN.
nlohmann::json as_json(const std::vector<double>& values) {
  nlohmann::json list = nlohmann::json::array();
  for (const double value : values) {
    if (std::isfinite(value)) {
      list.push_back(value);
    } else {
      list.push_back(nullptr);
    }
  }
  return list;
}

nlohmann::json wall_images(const DepthCalibrator& calibrator, const DepthCorrector& linear,
                           const DepthCorrector& paper) {
  nlohmann::json list = nlohmann::json::array();
  for (const WallMeasurement& wall : calibrator.walls()) {
    list.push_back({{"distance_m", wall.distance_m},
                    {"before", as_json(calibrator.tile_bias(wall, nullptr))},
                    {"after", as_json(calibrator.tile_bias(wall, &linear))},
                    {"paper", as_json(calibrator.tile_bias(wall, &paper))}});
  }
  return list;
}

void run(const std::string& program, const std::string& data, const std::string& out) {
  std::string arguments[] = {program, data, out};
  char* argv[] = {arguments[0].data(), arguments[1].data(), arguments[2].data(), nullptr};
  pid_t child = 0;
  int status = 0;
  const bool started = posix_spawn(&child, program.c_str(), nullptr, nullptr, argv, environ) == 0;
  if (!started || waitpid(child, &status, 0) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    throw UserError(fmt::format("{}: could not be drawn ({}{}); the calibration itself is written.", out,
                                program, started ? " failed" : " is missing"));
  }
}

}  // namespace

void write_calibration_report(const std::string& path, const DepthCalibration& calibration,
                              const DepthCalibrator& training, const DepthCalibrator& validation,
                              const nlohmann::json& figures) {
  DepthCorrectionConfig by_default, by_paper;
  by_paper.model = "paper";
  const DepthCorrector linear(by_default, calibration), paper(by_paper, calibration);
  nlohmann::json data = figures;
  data["trained_min_m"] = calibration.trained_min_m;
  data["trained_max_m"] = calibration.trained_max_m;
  data["columns"] = training.grid().columns;
  data["rows"] = training.grid().rows;
  data["training_images"] = wall_images(training, linear, paper);
  data["validation_images"] = wall_images(validation, linear, paper);
  data["tile_columns"] = calibration.columns();
  data["tile_rows"] = calibration.rows();
  data["tile_state"] = calibration.tile_state;
  data["tile_trained_max_m"] = calibration.tile_trained_max_m;
  constexpr double kFar_m = 20.0;
  std::vector<double> linear_far, paper_far;
  for (int r = 0; r < training.grid().rows; ++r) {
    for (int c = 0; c < training.grid().columns; ++c) {
      const double u = (c + 0.5) * training.grid().tile_px - 0.5,
                   v = (r + 0.5) * training.grid().tile_px - 0.5;
      linear_far.push_back(linear.correct_depth_m(u, v, kFar_m) / kFar_m - 1.0);
      paper_far.push_back(paper.correct_depth_m(u, v, kFar_m) / kFar_m - 1.0);
    }
  }
  data["far_m"] = kFar_m;
  data["far_default"] = as_json(linear_far);
  data["far_paper"] = as_json(paper_far);
  const std::string data_path = path + ".data.json";
  write_text_atomically(data_path, data.dump());
  try {
    run((fs::read_symlink("/proc/self/exe").parent_path() / "calibration_report").string(), data_path, path);
  } catch (...) {
    fs::remove(data_path);
    throw;
  }
  fs::remove(data_path);
}

}  // namespace knav
