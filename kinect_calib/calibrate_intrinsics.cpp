// calibrate_intrinsics: pictures of a chessboard (a folder, a bag, or a live topic) -> camera_info.
#include <cv_bridge/cv_bridge.h>
#include <fmt/format.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/Image.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/file_io.h"
#include "core/progress.h"
#include "kinect_calib/intrinsics_calibrator.h"
#include "ros_common/bag_reader.h"
#include "ros_common/command_line.h"

namespace knav {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string source, out, json, topic = "camera/ir/image", camera_name = "depth", board = "8x6", suffix;
  int views = 30;
  bool live = false;
  ChessboardConfig chessboard;
};

const char* const kHelp =
    R"(SOURCE is a folder of images, or a bag with sensor_msgs/Image; with --live none: images come from the topic until
there are enough views, or Ctrl-C. Cover the Kinect's projector and light the board, or the speckles hide it. Show
the board in every part of the image and tilted up to 45 degrees.
The JSON holds views and dropped_views (counts), reprojection_rms_px, covered (share of the image in which corners were
seen), fx_px, fy_px, cx_px, cy_px, each with its _sd_px, and distortion (k1 k2 p1 p2 k3).)";

void parse_board(Options* options) {
  char x = 0;
  int used = 0;
  ChessboardConfig& board = options->chessboard;
  if (std::sscanf(options->board.c_str(), "%d%c%d%n", &board.corners_across, &x, &board.corners_down,
                  &used) != 3 ||
      x != 'x' || used != static_cast<int>(options->board.size()) || board.corners_across < 3 ||
      board.corners_down < 3) {
    throw UserError(
        fmt::format("--board {}: give the inner corners as ACROSSxDOWN, such as 8x6.", options->board));
  }
}

cv::Mat image_of(const sensor_msgs::ImageConstPtr& message) {
  try {
    return cv_bridge::toCvShare(message)->image.clone();
  } catch (const cv_bridge::Exception& error) {
    throw UserError(fmt::format("an image cannot be read: {}", error.what()));
  }
}

void read_folder(const Options& options, IntrinsicsCalibrator* calibrator) {
  std::vector<std::string> paths;
  for (const auto& entry : fs::directory_iterator(options.source)) {
    const std::string name = entry.path().filename().string();
    const bool fits =
        name.size() >= options.suffix.size() &&
        name.compare(name.size() - options.suffix.size(), options.suffix.size(), options.suffix) == 0;
    if (entry.is_regular_file() && fits && cv::haveImageReader(entry.path().string())) {
      paths.push_back(entry.path().string());
    }
  }
  std::sort(paths.begin(), paths.end());
  if (paths.empty())
    throw UserError(fmt::format("{}: holds no images that end in '{}'.", options.source, options.suffix));
  Progress progress("looking for boards");
  for (std::size_t i = 0; i < paths.size(); ++i) {
    stop_if_interrupted();
    const cv::Mat image = cv::imread(paths[i], cv::IMREAD_UNCHANGED);
    if (image.empty()) throw UserError(paths[i] + ": cannot be read as an image.");
    try {
      calibrator->add_view(image);
    } catch (const UserError& error) {
      throw UserError(paths[i] + ": " + error.what());
    }
    progress.update(static_cast<double>(i + 1) / static_cast<double>(paths.size()),
                    fmt::format("{} views", calibrator->views()));
  }
}

void read_bag(const Options& options, IntrinsicsCalibrator* calibrator) {
  const BagReader bag(options.source);
  bag.require_topic(options.topic);
  Progress progress("looking for boards");
  bag.for_each({options.topic}, [&](const rosbag::MessageInstance& message, double done) {
    const auto image = message.instantiate<sensor_msgs::Image>();
    if (!image)
      throw UserError(fmt::format("{}: topic '{}' holds no images.", options.source, options.topic));
    if (calibrator->views() < options.views) calibrator->add_view(image_of(image));
    progress.update(done, fmt::format("{} views", calibrator->views()));
  });
}

void listen(const Options& options, IntrinsicsCalibrator* calibrator) {
  ros::NodeHandle node;
  Progress progress("looking for boards");
  const ros::Subscriber subscriber =
      node.subscribe<sensor_msgs::Image>(options.topic, 1, [&](const sensor_msgs::ImageConstPtr& message) {
        const auto view = calibrator->add_view(image_of(message));
        progress.update(
            static_cast<double>(calibrator->views()) / options.views,
            fmt::format("{} of {} views; {}", calibrator->views(), options.views,
                        view == IntrinsicsCalibrator::View::kNoBoard      ? "no board in sight"
                        : view == IntrinsicsCalibrator::View::kTooSimilar ? "move or tilt the board"
                                                                          : "taken"));
      });
  while (ros::ok() && !interrupted() && calibrator->views() < options.views) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.1));
  }
}

void calibrate(Options options) {
  parse_board(&options);
  IntrinsicsCalibrator calibrator(options.chessboard);
  if (options.live) {
    listen(options, &calibrator);
  } else if (options.source.empty()) {
    throw UserError("give a folder or a bag, or --live.");
  } else if (fs::is_directory(options.source)) {
    read_folder(options, &calibrator);
  } else {
    read_bag(options, &calibrator);
  }
  const IntrinsicsResult result = calibrator.calibrate();
  write_text_atomically(options.out, camera_info_text(result.camera, options.camera_name));
  const PinholeModel& k = result.camera.raw;
  const nlohmann::json json = {{"views", result.views},
                               {"dropped_views", result.dropped_views},
                               {"reprojection_rms_px", result.reprojection_rms_px},
                               {"covered", result.covered},
                               {"fx_px", k.fx_px},
                               {"fy_px", k.fy_px},
                               {"cx_px", k.cx_px},
                               {"cy_px", k.cy_px},
                               {"fx_sd_px", result.fx_sd_px},
                               {"fy_sd_px", result.fy_sd_px},
                               {"cx_sd_px", result.cx_sd_px},
                               {"cy_sd_px", result.cy_sd_px},
                               {"distortion", result.camera.distortion}};
  write_json(options.json, json.dump(2));
  if (options.json == "-") return;
  fmt::print("{} views ({} dropped), corners in {:.0f} % of the image, reprojection {:.3f} px rms\n",
             result.views, result.dropped_views, 100 * result.covered, result.reprojection_rms_px);
  fmt::print(
      "fx {:.2f} +- {:.2f}  fy {:.2f} +- {:.2f}  cx {:.2f} +- {:.2f}  cy {:.2f} +- {:.2f} px\nD [{:.4f}]\n",
      k.fx_px, result.fx_sd_px, k.fy_px, result.fy_sd_px, k.cx_px, result.cx_sd_px, k.cy_px, result.cy_sd_px,
      fmt::join(result.camera.distortion, ", "));
  if (result.covered < 0.6)
    fmt::print("Much of the image never saw the board: show it in the corners as well.\n");
  fmt::print("Written to {}; give it to openni2_camera as depth_camera_info_url (file://...).\n",
             options.out);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app("Calibrates a camera's lens from pictures of a chessboard.");
  knav::Options options;
  app.add_option("SOURCE", options.source, "folder of images, or a bag");
  app.add_option("--out", options.out, "camera_info file to write (YAML)")->required();
  app.add_option("--board", options.board, "inner corners, where four squares meet: ACROSSxDOWN")
      ->capture_default_str();
  app.add_option("--square", options.chessboard.square_m, "side of a square [m]")
      ->check(CLI::Range(0.001, 1.0))
      ->capture_default_str();
  app.add_option("--radial", options.chessboard.radial_terms, "radial distortion terms")
      ->check(CLI::Range(2, 3))
      ->capture_default_str();
  app.add_option("--views", options.views, "bag and live: stop at so many different views")
      ->check(CLI::Range(5, 500))
      ->capture_default_str();
  app.add_option("--topic", options.topic, "bag and live: images")->capture_default_str();
  app.add_option("--suffix", options.suffix, "folder: only files whose names end so");
  app.add_option("--camera-name", options.camera_name, "name to note in the file, such as depth_SERIAL")
      ->capture_default_str();
  app.add_flag("--live", options.live, "listen to the topic of a running camera");
  app.add_option("--json", options.json, "write the figures to this file; '-' for standard output");
  app.footer(knav::kHelp);
  ros::init(argc, argv, "calibrate_intrinsics",
            ros::init_options::AnonymousName | ros::init_options::NoSigintHandler);
  return knav::run_command(app, argc, argv, [&] { knav::calibrate(options); });
}
