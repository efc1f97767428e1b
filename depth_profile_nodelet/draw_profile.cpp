// draw_profile: depth images of a bag through the front end, as pictures to look at and figures.
#include <fmt/format.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2/buffer_core.h>
#include <tf2/exceptions.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/error.h"
#include "core/file_io.h"
#include "core/progress.h"
#include "depth_profile_nodelet/front_end.h"
#include "kinect_calib/depth_messages.h"
#include "ros_common/bag_reader.h"
#include "ros_common/command_line.h"
#include "ros_common/conversions.h"

namespace knav {
namespace {

struct Options {
  std::string bag, config, out, json, base_frame = "base_link";
  int every = 30;
  bool free_without_floor = false;
};

const char* const kHelp =
    R"(Each picture: above, the rectified depth (near is bright), what was taken away (floor, above 2 m) in blue; below, the
profile from above, 1 m squares, camera in the middle of the lower edge: free space grey, obstacles white (low yellow, high magenta).
The JSON holds frames (count), cpu_milliseconds_per_frame, floor_from_frame, floor_from_previous, floor_from_mount
(fractions of the frames), columns_with_obstacle, columns_with_free_space (fractions of all columns), median_z_m.)";

Eigen::Isometry3d isometry_from(const geometry_msgs::Transform& transform) {
  const auto& q = transform.rotation;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized().toRotationMatrix();
  T.translation() =
      Eigen::Vector3d(transform.translation.x, transform.translation.y, transform.translation.z);
  return T;
}

cv::Mat draw_depth(const cv::Mat& depth, const cv::Mat& sliced) {
  cv::Mat picture(depth.rows, depth.cols, CV_8UC3, cv::Scalar(0, 0, 0));
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u) {
      const float z = depth.at<float>(v, u);
      if (std::isnan(z)) continue;
      const auto shade = static_cast<unsigned char>(std::clamp(60.0 + 195.0 * 0.5 / z, 60.0, 255.0));
      const bool kept = !std::isnan(sliced.at<float>(v, u));
      picture.at<cv::Vec3b>(v, u) = kept ? cv::Vec3b(shade, shade, shade) : cv::Vec3b(shade, shade / 2, 0);
    }
  }
  return picture;
}

cv::Mat draw_profile(const DepthProfile& profile, double reach_m, const cv::Size& size) {
  cv::Mat picture(size, CV_8UC3, cv::Scalar(30, 30, 30));
  const double px_per_m = size.height / reach_m;
  const auto at = [&](double x, double z) {
    return cv::Point(static_cast<int>(size.width / 2.0 + x * px_per_m),
                     static_cast<int>(size.height - 1 - z * px_per_m));
  };
  const auto columns = static_cast<int>(profile.z_m.size());
  for (int u = 0; u < columns; ++u) {
    const double x = (u - profile.cx_px) / profile.fx_px;
    const auto column = static_cast<std::size_t>(u);
    const double from = profile.free_from_m[column],
                 to = std::min<double>(profile.free_to_m[column], reach_m);
    if (from < to) cv::line(picture, at(x * from, from), at(x * to, to), cv::Scalar(90, 90, 90));
  }
  for (int i = 0; i <= static_cast<int>(reach_m); ++i) {
    cv::line(picture, at(-reach_m, i), at(reach_m, i), cv::Scalar(60, 60, 60));
    cv::line(picture, at(i, 0), at(i, reach_m), cv::Scalar(60, 60, 60));
    cv::line(picture, at(-i, 0), at(-i, reach_m), cv::Scalar(60, 60, 60));
  }
  for (int u = 0; u < columns; ++u) {
    const auto column = static_cast<std::size_t>(u);
    const double z = profile.z_m[column], x = (u - profile.cx_px) / profile.fx_px;
    if (std::isnan(z) || z > reach_m) continue;
    const HeightClass height = profile.height_class[column];
    const cv::Scalar color = height == HeightClass::kLow    ? cv::Scalar(0, 255, 255)
                             : height == HeightClass::kHigh ? cv::Scalar(255, 0, 255)
                                                            : cv::Scalar(255, 255, 255);
    cv::circle(picture, at(x * z, z), 1, color, cv::FILLED);
  }
  return picture;
}

class Painter {
 public:
  explicit Painter(const Options& options) : options_(options), front_end_(config(options)) {}

  void run() {
    const BagReader bag(options_.bag);
    bag.require_topic("camera/depth/image_raw");
    bag.require_topic("camera/depth/camera_info");
    std::filesystem::create_directories(options_.out);
    // Transforms and odometry first: a frame's rows reach beyond its stamp.
    bag.for_each({"tf", "tf_static", "odom"}, [&](const rosbag::MessageInstance& message, double) {
      if (const auto tf = message.instantiate<tf2_msgs::TFMessage>()) {
        const bool fixed = message.getTopic().find("static") != std::string::npos;
        for (const auto& transform : tf->transforms) transforms_.setTransform(transform, "bag", fixed);
      } else if (const auto odometry = message.instantiate<nav_msgs::Odometry>()) {
        poses_.add(odometry->header.stamp.toSec(), pose2_from(odometry->pose.pose));
      }
    });
    Progress progress("draw_profile");
    bag.for_each({"camera/depth/image_raw", "camera/depth/camera_info"},
                 [&](const rosbag::MessageInstance& message, double done) {
                   if (const auto info = message.instantiate<sensor_msgs::CameraInfo>())
                     camera_ = raw_camera_from(*info);
                   if (const auto image = message.instantiate<sensor_msgs::Image>()) take(*image);
                   progress.update(done, fmt::format("{} frames", frames_));
                 });
    if (frames_ == 0)
      throw UserError(options_.bag + ": no frame could be used" + (why_not_.empty() ? "." : ": " + why_not_));
    report();
  }

 private:
  static FrontEndConfig config(const Options& options) {
    FrontEndConfig config = FrontEndConfig::from_file(options.config);
    config.floor_removal.free_without_floor |= options.free_without_floor;
    return config;
  }

  void take(const sensor_msgs::Image& image) {
    cv::Mat depth;
    if (camera_.raw.width_px == 0 || !view_depth(image, &depth, &why_not_)) return;
    Eigen::Isometry3d T_base_optical;
    try {
      T_base_optical = isometry_from(
          transforms_.lookupTransform(options_.base_frame, image.header.frame_id, image.header.stamp)
              .transform);
    } catch (const tf2::TransformException& error) {
      why_not_ = error.what();
      return;
    }
    const std::clock_t start = std::clock();
    if (!front_end_.process(depth, camera_, image.header.stamp.toSec(), T_base_optical, poses_, &profile_)) {
      why_not_ = front_end_.fault();
      return;
    }
    elapsed_s_ += static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    ++from_[static_cast<std::size_t>(front_end_.floor().source)];
    columns_ += static_cast<double>(profile_.z_m.size());
    for (std::size_t u = 0; u < profile_.z_m.size(); ++u) {
      if (!std::isnan(profile_.z_m[u])) depths_m_.push_back(profile_.z_m[u]);
      free_ += std::isnan(profile_.free_to_m[u]) ? 0.0 : 1.0;
    }
    if (frames_ % options_.every == 0) paint();
    ++frames_;
  }

  void paint() {
    float farthest_m = 3.0f;
    for (const float z : profile_.z_m) farthest_m = z > farthest_m ? z : farthest_m;
    const cv::Mat above = draw_depth(front_end_.unrolled(), front_end_.sliced());
    const cv::Mat below = draw_profile(profile_, std::min(20.0, std::ceil(farthest_m + 0.5)), above.size());
    cv::Mat picture;
    cv::vconcat(above, below, picture);
    static const char* const kSources[] = {"frame", "previous", "mount"};
    const FloorResult& floor = front_end_.floor();
    cv::putText(
        picture,
        fmt::format("floor: {} ({:.0f} %), camera {:.2f} m up", kSources[static_cast<int>(floor.source)],
                    100 * floor.vote_fraction, floor.plane.height_m),
        {8, above.rows + 18}, cv::FONT_HERSHEY_SIMPLEX, 0.5, cv::Scalar(200, 255, 200), 1, cv::LINE_AA);
    const auto path = std::filesystem::path(options_.out) / fmt::format("profile_{:05d}.png", frames_);
    write_file_atomically(path.string(), [&](const std::string& beside) { cv::imwrite(beside, picture); });
  }

  void report() {
    const auto middle = depths_m_.begin() + static_cast<std::ptrdiff_t>(depths_m_.size() / 2);
    std::nth_element(depths_m_.begin(), middle, depths_m_.end());
    const double n = frames_;
    const nlohmann::json json = {{"frames", frames_},
                                 {"cpu_milliseconds_per_frame", 1e3 * elapsed_s_ / n},
                                 {"floor_from_frame", from_[0] / n},
                                 {"floor_from_previous", from_[1] / n},
                                 {"floor_from_mount", from_[2] / n},
                                 {"columns_with_obstacle", static_cast<double>(depths_m_.size()) / columns_},
                                 {"columns_with_free_space", free_ / columns_},
                                 {"median_z_m", depths_m_.empty() ? 0.0 : *middle}};
    fmt::print("{}\n", json.dump(2));
    if (options_.json != "-") write_json(options_.json, json.dump(2));
  }

  const Options& options_;
  FrontEnd front_end_;
  tf2::BufferCore transforms_{ros::Duration(1e6)};
  PoseBuffer poses_{1 << 20};
  RawCamera camera_;
  DepthProfile profile_;
  std::string why_not_;
  int frames_ = 0;
  double elapsed_s_ = 0.0, columns_ = 0.0, free_ = 0.0;
  double from_[3] = {0.0, 0.0, 0.0};
  std::vector<float> depths_m_;
};

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app("Runs a recording's depth images through the front end and draws what comes out.");
  knav::Options options;
  app.add_option("BAG", options.bag, "recording with camera/depth/image_raw, camera_info, tf")->required();
  app.add_option("--out", options.out, "folder for the pictures")->required();
  app.add_option("--config", options.config, "configuration file, as config/default.yaml");
  app.add_option("--every", options.every, "draw every Nth frame")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--base-frame", options.base_frame, "TF frame on the floor")->capture_default_str();
  app.add_flag("--free-without-floor", options.free_without_floor, "as floor_removal/free_without_floor");
  app.add_option("--json", options.json, "write the figures to this file");
  app.footer(knav::kHelp);
  return knav::run_command(app, argc, argv, [&] { knav::Painter(options).run(); });
}
