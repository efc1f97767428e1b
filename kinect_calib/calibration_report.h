#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "kinect_calib/depth_calibration.h"
#include "kinect_calib/depth_calibrator.h"

namespace knav {

/// Writes the calibration's page: hands figures and tile images to the script `calibration_report` beside
/// this program, which draws them.
/// @param figures what calibrate_depth --json writes
/// UserError if the script cannot be run or fails.
void write_calibration_report(const std::string& path, const DepthCalibration& calibration,
                              const DepthCalibrator& training, const DepthCalibrator& validation,
                              const nlohmann::json& figures);

}  // namespace knav
