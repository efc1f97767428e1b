// calibrate_depth: frames of a flat wall at known distances -> the sensor's depth correction and a report.
#include "kinect_calib/depth_calibration_run.h"
#include "ros_common/command_line.h"

namespace knav {
namespace {

const char* const kHelp =
    R"(SOURCE is a folder with distances.csv (lines `file,distance_m`; PNG, 16 bit, mm, 0 invalid) or a bag with depth
images and a sensor_msgs/Range topic, of which the frames count that were taken standing still. Distances: from the camera to the wall along the optical axis, 0.5 to 4 m in steps
of 5-15 %, several frames at each.
A --report that ends in .html is a page with pictures (needs python3-matplotlib), any other a table as text.
The JSON holds device, tile_px, filled_tiles, wild_tiles, held_quadratics (counts), and the lists training and
validation, each entry with distance_m, frames (count) and, relative to the distance, mean_bias_before, mean_bias_after,
mean_bias_after_offset, mean_bias_after_paper and the same of tile_bias_p95 (95th percentile over tiles of the absolute
bias; offset and paper: depth_correction's other models). With --compare-tiles also tiles, the same lists per tile_px.)";

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app("Learns a depth sensor's systematic error from frames of a flat wall at known distances.");
  knav::DepthCalibrationOptions options;
  app.add_option("SOURCE", options.input, "folder with distances.csv, or a bag")->required();
  knav::add_fit_options(&app, &options);
  app.add_option("--camera-info", options.camera_info,
                 "camera_calibration's YAML: lens to rectify (default: the folder's camera_info.yaml, the "
                 "bag's, or none)");
  app.add_option("--depth-topic", options.topics.depth, "bag: depth images")->capture_default_str();
  app.add_option("--info-topic", options.topics.info, "bag: camera_info")->capture_default_str();
  app.add_option("--range-topic", options.topics.range, "bag: sensor_msgs/Range of the range finder")
      ->capture_default_str();
  app.add_option("--range-offset", options.topics.range_offset_m,
                 "bag: added to each range to get the camera's distance [m]");
  app.footer(knav::kHelp);
  return knav::run_command(app, argc, argv, [&] { knav::run_depth_calibration(options); });
}
