// import_depth_images: a folder of depth images with camera poses as a bag that replay and the nodelets read.
#include <fmt/format.h>
#include <rosbag/bag.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <filesystem>

#include "core/error.h"
#include "core/file_io.h"
#include "core/progress.h"
#include "ros_common/command_line.h"
#include "tools/depth_bag_writer.h"
#include "tools/depth_image_recording.h"
#include "tools/level_poses.h"

namespace knav {
namespace {

struct Options {
  std::string folder, out, layout;
  double rate_hz = 30.0;
};

void import(const Options& options) {
  if (!std::filesystem::is_directory(options.folder)) throw UserError(options.folder + ": no such folder.");
  DepthImageRecording recording =
      options.layout == "tum" ? read_tum(options.folder) : read_seven_scenes(options.folder, options.rate_hz);
  if (!recording.level) level_poses(&recording);
  Progress progress("import_depth_images");
  std::size_t written = 0, without_pose = 0;
  write_file_atomically(options.out, [&](const std::string& beside) {
    rosbag::Bag bag(beside, rosbag::bagmode::Write);
    DepthBagWriter writer(&bag);
    const double margin_s = 0.2;
    const double first_s = recording.frames.front().stamp_s - margin_s,
                 last_s = recording.frames.back().stamp_s + margin_s;
    auto pose = std::find_if(recording.poses.begin(), recording.poses.end(),
                             [&](const StampedCameraPose& p) { return p.stamp_s >= first_s; });
    if (pose == recording.poses.end()) {
      throw UserError(options.folder + ": no pose has a stamp of the images' time.");
    }
    writer.mount(pose->stamp_s);
    double written_s = -1.0;
    const auto write_poses = [&](double until_s) {
      for (; pose != recording.poses.end() && pose->stamp_s < until_s && pose->stamp_s <= last_s; ++pose) {
        writer.pose(pose->stamp_s, pose->T_world_optical);
        written_s = pose->stamp_s;
      }
    };
    for (std::size_t i = 0; i < recording.frames.size(); ++i) {
      stop_if_interrupted();
      const DepthImage& frame = recording.frames[i];
      write_poses(frame.stamp_s);
      Eigen::Isometry3d T_world_optical;
      if (!pose_at(recording.poses, frame.stamp_s, &T_world_optical)) {
        ++without_pose;
        continue;
      }
      if (frame.stamp_s > written_s) writer.pose(frame.stamp_s, T_world_optical);
      if (pose != recording.poses.end() && pose->stamp_s == frame.stamp_s) ++pose;
      writer.frame(frame.stamp_s, recording.camera, read_depth(recording, frame));
      ++written;
      progress.update(static_cast<double>(i + 1) / static_cast<double>(recording.frames.size()),
                      fmt::format("{} frames", written));
    }
    write_poses(last_s + 1.0);
    bag.close();
    if (written == 0)
      throw UserError(options.folder + ": no image has a pose of its time (within 0.1 s on both sides).");
  });
  fmt::print("{}: {} frames, {:.1f} s{}\n", options.out, written,
             recording.frames.back().stamp_s - recording.frames.front().stamp_s,
             without_pose > 0 ? fmt::format("; {} left out for want of a pose", without_pose) : "");
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(
      "Turns a folder of depth images with camera poses into a bag: camera/depth/image_raw (16UC1 mm), "
      "camera_info,\n"
      "ground_truth and odom (the poses reduced to the plane: base_link is the camera's vertical projection "
      "on the floor),\n"
      "tf (odom -> base_link -> camera_link with the camera's own height and tilt at every pose) and "
      "tf_static.\n"
      "odom carries no error: it is the true motion.");
  knav::Options options;
  app.add_option("DIR", options.folder, "the folder")->required();
  app.add_option("OUT", options.out, "bag to write")->required();
  app.add_option("--layout", options.layout,
                 "tum: depth.txt, depth/, groundtruth.txt (z up, floor at 0; 1/5000 m). seven_scenes: "
                 "data/frame-*.depth.png "
                 "(mm) with .pose.txt, camera-intrinsics.txt; the vertical is found from floor and tables")
      ->required()
      ->check(CLI::IsMember({"tum", "seven_scenes"}));
  app.add_option("--rate", options.rate_hz, "seven_scenes: frames a second [Hz]")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  return knav::run_command(app, argc, argv, [&] { knav::import(options); });
}
