#pragma once

#include <string>

#include "kinect_calib/wall_loader.h"

namespace CLI {
class App;
}

namespace knav {

/// What calibrate_depth is asked to do once there are frames.
struct DepthCalibrationOptions {
  std::string input, out, validate, camera_info, device, report, json;
  WallTopics topics;
  int tile_px = 16;
  bool keep_bands = false, square = false, compare_tiles = false;
};

/// The options of the fit and the report, for the command line.
void add_fit_options(CLI::App* app, DepthCalibrationOptions* options);

/// Walls -> calibration file, table, report and figures.
void run_depth_calibration(const DepthCalibrationOptions& options);

}  // namespace knav
