// calibrate_depth: frames of a flat wall at known distances -> the sensor's depth correction and a report.
#include <fmt/format.h>
#include <sensor_msgs/Range.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/progress.h"
#include "kinect_calib/calibration_report.h"
#include "kinect_calib/depth_calibrator.h"
#include "kinect_calib/depth_corrector.h"
#include "kinect_calib/depth_messages.h"
#include "ros_common/bag_reader.h"
#include "ros_common/command_line.h"

namespace knav {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string input, out, validate, camera_info, device, report, json;
  std::string depth_topic = "camera/depth/image_raw", info_topic = "camera/depth/camera_info",
              range_topic = "range";
  double range_offset_m = 0.0;
  int tile_px = 16;
  bool keep_bands = false, square = false, compare_tiles = false;
};

const char* const kHelp =
    R"(SOURCE is a folder with distances.csv (lines `file,distance_m`; PNG, 16 bit, mm, 0 invalid) or a bag with depth
images and a sensor_msgs/Range topic, of which the frames count that were taken standing still. Distances: from the camera to the wall along the optical axis, 0.5 to 4 m in steps
of 5-15 %, several frames at each.
A --report that ends in .html is a page with pictures (needs python3-matplotlib), any other a table as text.
The JSON holds device, tile_px, filled_tiles, wild_tiles, held_quadratics (counts), and the lists training and
validation, each entry with distance_m, frames (count) and, relative to the distance, mean_bias_before, mean_bias_after,
mean_bias_after_offset, mean_bias_after_paper and the same of tile_bias_p95 (95th percentile over tiles of the absolute
bias; offset and paper: depth_correction's other models). With --compare-tiles also tiles, the same lists per tile_px.)";

RawCamera default_camera(int width_px, int height_px) {
  RawCamera camera;
  const double focal_px = 585.0 * width_px / 640.0;
  camera.raw = {width_px, height_px, focal_px, focal_px, 0.5 * (width_px - 1), 0.5 * (height_px - 1)};
  camera.rectified = camera.raw;
  return camera;
}

/// A file as camera_calibration writes it.
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

struct Frame {
  std::string file;
  double distance_m;
};
std::vector<Frame> read_distances(const std::string& folder) {
  const std::string path = (fs::path(folder) / "distances.csv").string();
  std::istringstream text(read_text_file(path));
  std::vector<Frame> frames;
  std::string line;
  for (int number = 1; std::getline(text, line); ++number) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line[0] == '#') continue;
    const std::size_t comma = line.find(',');
    Frame frame;
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

/// Rectifies, but corrects nothing.
class Loader {
 public:
  explicit Loader(const Options& options) : options_(options), corrector_(DepthCorrectionConfig{}) {
    if (!options.camera_info.empty()) camera_ = read_camera_info(options.camera_info);
  }

  /// Each frame goes to all calibrators.
  void load(const std::string& source, const std::string& stage,
            const std::vector<DepthCalibrator*>& calibrators) {
    calibrators_ = calibrators;
    if (fs::is_directory(source)) {
      load_folder(source, stage);
    } else {
      load_bag(source, stage);
    }
  }

 private:
  void add(const std::string& where, const cv::Mat& raw, double distance_m) {
    if (camera_.raw.width_px == 0) camera_ = default_camera(raw.cols, raw.rows);
    if (!corrector_.correct(raw, camera_, &metres_)) throw UserError(where + ": " + corrector_.fault());
    try {
      for (DepthCalibrator* calibrator : calibrators_) {
        calibrator->add_frame(metres_, camera_.rectified, distance_m);
      }
    } catch (const UserError& error) {
      throw UserError(where + ": " + error.what());
    }
  }

  void load_folder(const std::string& folder, const std::string& stage) {
    const std::vector<Frame> frames = read_distances(folder);
    Progress progress(stage);
    for (std::size_t i = 0; i < frames.size(); ++i) {
      stop_if_interrupted();
      const std::string path = (fs::path(folder) / frames[i].file).string();
      const cv::Mat image = cv::imread(path, cv::IMREAD_UNCHANGED);
      if (image.empty()) throw UserError(path + ": cannot be read as an image; distances.csv names it.");
      if (image.type() != CV_16UC1)
        throw UserError(path + ": must be a PNG with one channel of 16 bits (mm).");
      add(path, image, frames[i].distance_m);
      progress.update(static_cast<double>(i + 1) / static_cast<double>(frames.size()), frames[i].file);
    }
  }

  void load_bag(const std::string& path, const std::string& stage) {
    const BagReader bag(path);
    bag.require_topic(options_.depth_topic);
    bag.require_topic(options_.range_topic);
    const std::vector<RangeReading> readings = read_ranges(bag);
    Progress progress(stage);
    int used = 0, skipped = 0;
    std::string why;
    bag.for_each({options_.depth_topic, options_.info_topic},
                 [&](const rosbag::MessageInstance& message, double done) {
                   if (const auto info = message.instantiate<sensor_msgs::CameraInfo>()) {
                     if (options_.camera_info.empty()) camera_ = raw_camera_from(*info);
                   } else {
                     double range_m = 0.0;
                     if (!stands_still(readings, message.getTime().toSec(), &range_m)) return;
                     const auto image = message.instantiate<sensor_msgs::Image>();
                     if (!image)
                       throw UserError(path + ": topic '" + options_.depth_topic + "' holds no images.");
                     cv::Mat view;
                     std::string fault;
                     if (!view_depth(*image, &view, &fault)) throw UserError(path + ": " + fault);
                     try {
                       add(path, view, range_m);
                       ++used;
                     } catch (const UserError& error) {  // it stood somewhere else for a while
                       ++skipped;
                       why = error.what();
                     }
                     progress.update(done, fmt::format("{} frames", used));
                   }
                 });
    if (skipped > 0)
      fmt::print(stderr, "calibrate_depth: {} frames left out, the last because {}\n", skipped, why);
    if (used == 0) {
      throw UserError(
          fmt::format("{}: no depth image was taken with the robot standing still (a steady '{}' for {} s "
                      "before and after).",
                      path, options_.range_topic, kStillFor_s));
    }
  }

  struct RangeReading {
    double stamp_s, range_m;
  };

  std::vector<RangeReading> read_ranges(const BagReader& bag) const {
    std::vector<RangeReading> readings;
    bag.for_each({options_.range_topic}, [&](const rosbag::MessageInstance& message, double) {
      const auto range = message.instantiate<sensor_msgs::Range>();
      if (!range)
        throw UserError(bag.path() + ": topic '" + options_.range_topic + "' holds no sensor_msgs/Range.");
      readings.push_back({message.getTime().toSec(), range->range + options_.range_offset_m});
    });
    return readings;
  }

  /// Frames taken while the robot drives or turns to its next distance show no wall squarely: only those
  /// count round which the range finder is steady, and their distance is its mean.
  static bool stands_still(const std::vector<RangeReading>& readings, double stamp_s, double* range_m) {
    auto reading = std::lower_bound(readings.begin(), readings.end(), stamp_s - kStillFor_s,
                                    [](const RangeReading& r, double s) { return r.stamp_s < s; });
    double sum = 0.0, low = 1e9, high = -1e9;
    int before = 0, after = 0;
    for (; reading != readings.end() && reading->stamp_s <= stamp_s + kStillFor_s; ++reading) {
      if (!std::isfinite(reading->range_m)) return false;
      sum += reading->range_m;
      low = std::min(low, reading->range_m);
      high = std::max(high, reading->range_m);
      ++(reading->stamp_s <= stamp_s ? before : after);
    }
    if (before < 2 || after < 2 || high - low > kSteadyWithin_m) return false;
    *range_m = sum / (before + after);
    return *range_m <= kFarthestWall_m;
  }

  static constexpr double kStillFor_s = 0.4;
  static constexpr double kSteadyWithin_m = 0.015;  // five times a range finder's 2 mm, and a little
  static constexpr double kFarthestWall_m = 5.0;    // the paper's 4 m, and a little

  const Options& options_;
  DepthCorrector corrector_;
  RawCamera camera_;
  cv::Mat metres_;
  std::vector<DepthCalibrator*> calibrators_;
};

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

void calibrate(const Options& options) {
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
  Loader loader(options);
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

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app("Learns a depth sensor's systematic error from frames of a flat wall at known distances.");
  knav::Options options;
  app.add_option("SOURCE", options.input, "folder with distances.csv, or a bag")->required();
  app.add_option("--out", options.out, "calibration to write (YAML)")->required();
  app.add_option("--validate", options.validate, "folder or bag not used in fitting, to score the result on");
  app.add_option("--camera-info", options.camera_info,
                 "camera_calibration's YAML: lens to rectify (default: none, or the bag's)");
  app.add_option("--device", options.device, "serial number or name to note in the file");
  app.add_option("--tile", options.tile_px, "side of a tile [px]")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  app.add_option("--depth-topic", options.depth_topic, "bag: depth images")->capture_default_str();
  app.add_option("--info-topic", options.info_topic, "bag: camera_info")->capture_default_str();
  app.add_option("--range-topic", options.range_topic, "bag: sensor_msgs/Range of the range finder")
      ->capture_default_str();
  app.add_option("--range-offset", options.range_offset_m,
                 "bag: added to each range to get the camera's distance [m]");
  app.add_flag("--keep-bands", options.keep_bands, "do not remove vertical bands from each frame");
  app.add_flag("--square", options.square, "the sensor stood exactly square to the wall: fit no tilt");
  app.add_flag("--compare-tiles", options.compare_tiles,
               "also calibrate with tiles of 1 to 64 px, and compare");
  app.add_option("--report", options.report, "write a page (.html) or the table (any other) to this file");
  app.add_option("--json", options.json, "write the figures to this file; '-' for standard output");
  app.footer(knav::kHelp);
  return knav::run_command(app, argc, argv, [&] { knav::calibrate(options); });
}
