// extract_profiles: a recording with raw depth as one with depth profiles, a two-hundredth of its size.
#include <fmt/format.h>
#include <kinect_nav/DepthProfile.h>
#include <rosbag/bag.h>
#include <sensor_msgs/Image.h>

#include "core/config.h"
#include "core/error.h"
#include "core/file_io.h"
#include "core/progress.h"
#include "depth_profile_nodelet/front_end.h"
#include "global_map_builder/build_map_config.h"
#include "ros_common/bag_reader.h"
#include "ros_common/command_line.h"
#include "ros_common/conversions.h"

namespace knav {
namespace {

std::string depth_frame(const BagReader& bag, const std::string& topic) {
  struct Found {};
  std::string frame;
  try {
    bag.for_each({topic}, [&](const rosbag::MessageInstance& message, double) {
      const auto image = message.instantiate<sensor_msgs::Image>();
      if (image) frame = image->header.frame_id;
      throw Found{};
    });
  } catch (const Found&) {
  }
  return frame;
}

void extract(const std::string& in, const std::string& out, const std::string& config_file) {
  auto config = read_config_section<BuildMapConfig>(config_file, "map_builder").recording;
  config.source = "depth";
  ObservationReader reader(in, config, FrontEndConfig::from_file(config_file));
  const BagReader bag(in);
  write_file_atomically(out, [&](const std::string& part) {
    rosbag::Bag written(part, rosbag::bagmode::Write);
    Progress progress("extract_profiles");
    kinect_nav::DepthProfile message;
    message.header.frame_id = depth_frame(bag, config.depth_topic);
    ObservationCallbacks callbacks;
    callbacks.profile = [&](const DepthProfile& profile, const Pose2&) {
      profile_message(profile, &message);
      written.write(config.profile_topic, message.header.stamp, message);
    };
    callbacks.progress = [&](double fraction) { progress.update(fraction); };
    reader.read(callbacks);
    bag.for_each({config.odometry_topic, "tf", "tf_static", config.mark_topic, config.joy_topic,
                  "ground_truth", config.camera_info_topic},
                 [&](const rosbag::MessageInstance& m, double) {
                   written.write(m.getTopic(), m.getTime(), m, m.getConnectionHeader());
                 });
    written.close();
  });
  for (const std::string& warning : reader.warnings()) fmt::print(stderr, "extract_profiles: {}\n", warning);
  fmt::print("{}: {} profiles\n", out, reader.statistics().observations);
}

}  // namespace
}  // namespace knav

int main(int argc, char** argv) {
  CLI::App app(
      "Turns the raw depth of a recording into depth profiles (calibration, rolling shutter and floor as in "
      "the\n"
      "configuration) and keeps odometry, TF, marks and ground truth: to archive a drive, or to build from "
      "it often.");
  std::string in, out, config;
  app.add_option("BAG", in, "recording with depth images")->required();
  app.add_option("OUT", out, "recording to write")->required();
  app.add_option("--config", config, "configuration file, as config/default.yaml");
  return knav::run_command(app, argc, argv, [&] { knav::extract(in, out, config); });
}
