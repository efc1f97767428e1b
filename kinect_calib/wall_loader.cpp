#include "kinect_calib/wall_loader.h"

#include <fmt/format.h>
#include <sensor_msgs/Range.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "core/progress.h"
#include "kinect_calib/depth_messages.h"
#include "kinect_calib/standing_range.h"
#include "kinect_calib/wall_folder.h"
#include "ros_common/program.h"

namespace knav {
namespace {

namespace fs = std::filesystem;

constexpr double kStillFor_s = 0.4;
constexpr double kFarthestWall_m = 5.0;  // the paper's 4 m, and a little

RawCamera default_camera(int width_px, int height_px) {
  RawCamera camera;
  const double focal_px = 585.0 * width_px / 640.0;
  camera.raw = {width_px, height_px, focal_px, focal_px, 0.5 * (width_px - 1), 0.5 * (height_px - 1)};
  camera.rectified = camera.raw;
  return camera;
}

}  // namespace

WallLoader::WallLoader(const WallTopics& topics, const std::string& camera_info)
    : topics_(topics), camera_given_(!camera_info.empty()), corrector_(DepthCorrectionConfig{}) {
  if (camera_given_) camera_ = read_camera_info(camera_info);
}

void WallLoader::load(const std::string& source, const std::string& stage,
                      const std::vector<DepthCalibrator*>& calibrators) {
  calibrators_ = calibrators;
  if (fs::is_directory(source)) {
    load_folder(source, stage);
  } else {
    load_bag(source, stage);
  }
}

void WallLoader::add(const std::string& where, const cv::Mat& raw, double distance_m) {
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

void WallLoader::load_folder(const std::string& folder, const std::string& stage) {
  const std::vector<WallFrame> frames = read_distances(folder);
  const fs::path camera_info = fs::path(folder) / WallFolder::kCamera;
  if (!camera_given_ && fs::exists(camera_info)) camera_ = read_camera_info(camera_info.string());
  Progress progress(stage);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    stop_if_interrupted();
    const std::string path = (fs::path(folder) / frames[i].file).string();
    const cv::Mat image = cv::imread(path, cv::IMREAD_UNCHANGED);
    if (image.empty()) throw UserError(path + ": cannot be read as an image; distances.csv names it.");
    if (image.type() != CV_16UC1) throw UserError(path + ": must be a PNG with one channel of 16 bits (mm).");
    add(path, image, frames[i].distance_m);
    progress.update(static_cast<double>(i + 1) / static_cast<double>(frames.size()), frames[i].file);
  }
}

void WallLoader::load_bag(const std::string& path, const std::string& stage) {
  const BagReader bag(path);
  bag.require_topic(topics_.depth);
  bag.require_topic(topics_.range);
  const std::vector<RangeReading> readings = read_ranges(bag);
  Progress progress(stage);
  int used = 0, skipped = 0;
  std::string why;
  bag.for_each({topics_.depth, topics_.info}, [&](const rosbag::MessageInstance& message, double done) {
    if (const auto info = message.instantiate<sensor_msgs::CameraInfo>()) {
      if (!camera_given_) camera_ = raw_camera_from(*info);
    } else {
      double range_m = 0.0;
      if (!stands_still(readings, message.getTime().toSec(), &range_m)) return;
      const auto image = message.instantiate<sensor_msgs::Image>();
      if (!image) throw UserError(path + ": topic '" + topics_.depth + "' holds no images.");
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
                    path, topics_.range, kStillFor_s));
  }
}

std::vector<WallLoader::RangeReading> WallLoader::read_ranges(const BagReader& bag) const {
  std::vector<RangeReading> readings;
  bag.for_each({topics_.range}, [&](const rosbag::MessageInstance& message, double) {
    const auto range = message.instantiate<sensor_msgs::Range>();
    if (!range) throw UserError(bag.path() + ": topic '" + topics_.range + "' holds no sensor_msgs/Range.");
    readings.push_back({message.getTime().toSec(), range->range + topics_.range_offset_m});
  });
  return readings;
}

/// Frames taken while the robot drives or turns to its next distance show no wall squarely: only those
/// count round which the range finder is steady, and their distance is its mean.
bool WallLoader::stands_still(const std::vector<RangeReading>& readings, double stamp_s, double* range_m) {
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
  if (before < 2 || after < 2 || high - low > kSteadyRangeWithin_m) return false;
  *range_m = sum / (before + after);
  return *range_m <= kFarthestWall_m;
}

}  // namespace knav
