#include "global_map_builder/observation_source.h"

#include <fmt/format.h>
#include <kinect_nav/DepthProfile.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/error.h"
#include "global_map_builder/bag_message.h"
#include "global_map_builder/observation_reader.h"
#include "kinect_calib/depth_messages.h"

namespace knav {
namespace {

constexpr double kTransformSearch_s = 30.0;

/// Thrown to end a search through the bag early.
struct Found {};

Pose2 planar(const Eigen::Isometry3d& T) {
  return {T.translation().x(), T.translation().y(), std::atan2(T.linear()(1, 0), T.linear()(0, 0))};
}

/// The optical frame's z axis looks forward.
Pose2 planar_optical(const Eigen::Isometry3d& T) {
  return {T.translation().x(), T.translation().y(), std::atan2(T.linear()(1, 2), T.linear()(0, 2))};
}

template <class Visit>
void search(const BagReader& bag, const std::vector<std::string>& topics, const Visit& visit) {
  try {
    bag.for_each(topics, [&](const rosbag::MessageInstance& message, double) { visit(message); });
  } catch (const Found&) {
  }
}

/// `name` if the bag has it, else the only topic of that type, else empty.
std::string topic_or_only(const BagReader& bag, const std::string& name, const std::string& type,
                          std::vector<std::string>* warnings) {
  const auto topics = bag.topics_of_type(type);
  const auto same = [&](const std::string& t) {
    return without_leading_slash(t) == without_leading_slash(name);
  };
  if (std::any_of(topics.begin(), topics.end(), same)) return name;
  if (bag.has_topic(name)) {
    throw UserError(fmt::format("{}: topic '{}' is not of type {}.", bag.path(), name, type));
  }
  if (topics.size() != 1) return "";
  warnings->push_back(
      fmt::format("topic '{}' is not in {}; taking '{}', its only {}.", name, bag.path(), topics[0], type));
  return topics[0];
}

void choose_source(const BagReader& bag, const ObservationReaderConfig& config, ObservationSource* source,
                   std::vector<std::string>* warnings) {
  struct Choice {
    const char* source;
    const std::string& topic;
    const char* type;
  };
  const Choice choices[] = {{"profile", config.profile_topic, "kinect_nav/DepthProfile"},
                            {"depth", config.depth_topic, "sensor_msgs/Image"},
                            {"scan", config.scan_topic, "sensor_msgs/LaserScan"}};
  for (const Choice& choice : choices) {
    const bool automatic = config.source == "auto";
    if (!automatic && config.source != choice.source) continue;
    if (automatic && !bag.has_topic(choice.topic)) continue;
    source->kind = choice.source;
    source->topic = topic_or_only(bag, choice.topic, choice.type, warnings);
    if (source->topic.empty()) bag.require_topic(choice.topic);
    return;
  }
  for (const Choice& choice : choices) {  // none by its usual name: the only one of its type
    if (choice.source == std::string("depth")) continue;
    source->topic = topic_or_only(bag, choice.topic, choice.type, warnings);
    source->kind = choice.source;
    if (!source->topic.empty()) return;
  }
  throw UserError(fmt::format("{}: holds no observations: none of the topics '{}', '{}' and '{}' is in it.",
                              bag.path(), config.profile_topic, config.depth_topic, config.scan_topic));
}

void choose_odometry(const BagReader& bag, const ObservationReaderConfig& config, ObservationSource* source,
                     std::vector<std::string>* warnings) {
  source->odometry_topic = topic_or_only(bag, config.odometry_topic, "nav_msgs/Odometry", warnings);
  if (source->odometry_topic.empty()) bag.require_topic(config.odometry_topic);
  source->base_frame = config.base_frame;
  search(bag, {source->odometry_topic}, [&](const rosbag::MessageInstance& message) {
    const auto odometry = instantiate<nav_msgs::Odometry>(bag, message);
    if (!odometry->child_frame_id.empty())
      source->base_frame = without_leading_slash(odometry->child_frame_id);
    throw Found{};
  });
}

/// The mount came from `tf`: it may move, and then every frame has its own.
void follow_mount(const BagReader& bag, FixedTransforms transforms, const std::string& sensor,
                  ObservationSource* source) {
  bag.for_each({"tf"}, [&](const rosbag::MessageInstance& message, double) {
    const auto tf = instantiate<tf2_msgs::TFMessage>(bag, message);
    for (const auto& transform : tf->transforms) {
      const bool above_base = without_leading_slash(transform.child_frame_id) == source->base_frame;
      Eigen::Isometry3d T_base_sensor;
      if (above_base || !transforms.replace(transform) ||
          !transforms.find(source->base_frame, sensor, &T_base_sensor))
        continue;
      source->mount.add(transform.header.stamp.toSec(), T_base_sensor);
    }
  });
}

void find_transforms(const BagReader& bag, ObservationSource* source, std::vector<std::string>* warnings) {
  std::string sensor;
  search(bag, {source->topic}, [&](const rosbag::MessageInstance& message) {
    if (source->kind == "profile")
      sensor = instantiate<kinect_nav::DepthProfile>(bag, message)->header.frame_id;
    if (source->kind == "depth") sensor = instantiate<sensor_msgs::Image>(bag, message)->header.frame_id;
    if (source->kind == "scan") sensor = instantiate<sensor_msgs::LaserScan>(bag, message)->header.frame_id;
    throw Found{};
  });
  FixedTransforms transforms;
  const auto add = [&](const rosbag::MessageInstance& message) {
    const auto tf = instantiate<tf2_msgs::TFMessage>(bag, message);
    for (const auto& transform : tf->transforms) transforms.add(transform);
  };
  search(bag, {"tf_static"}, add);
  bool found = transforms.find(source->base_frame, sensor, &source->T_base_sensor);
  std::optional<ros::Time> start;
  if (!found) {
    search(bag, {"tf"}, [&](const rosbag::MessageInstance& message) {
      add(message);
      if (!start) start = message.getTime();
      found = transforms.find(source->base_frame, sensor, &source->T_base_sensor);
      if (found || (message.getTime() - *start).toSec() > kTransformSearch_s) throw Found{};
    });
  }
  if (found && start && source->kind == "depth") follow_mount(bag, transforms, sensor, source);
  if (found) {
    source->T_plane =
        source->kind == "scan" ? planar(source->T_base_sensor) : planar_optical(source->T_base_sensor);
    source->upside_down = source->kind == "scan" && source->T_base_sensor.linear()(2, 2) < 0.0;
    return;
  }
  const std::string missing =
      fmt::format("{}: has no transform from '{}' to the sensor's frame '{}' on tf_static or tf", bag.path(),
                  source->base_frame, sensor);
  if (source->kind == "depth") throw UserError(missing + "; the camera's height and tilt must be known.");
  warnings->push_back(missing + "; taking the sensor to be at the robot's centre, looking forward.");
}

}  // namespace

void ObservationSource::place_sensor(double stamp_s) {
  if (mount.empty()) return;
  T_base_sensor = mount.at(stamp_s);
  T_plane = planar_optical(T_base_sensor);
}

ObservationSource find_observation_source(const BagReader& bag, const ObservationReaderConfig& config,
                                          std::vector<std::string>* warnings) {
  ObservationSource source;
  choose_source(bag, config, &source, warnings);
  choose_odometry(bag, config, &source, warnings);
  find_transforms(bag, &source, warnings);
  return source;
}

RawCamera find_depth_camera(const BagReader& bag, const ObservationReaderConfig& config,
                            std::vector<std::string>* warnings) {
  RawCamera camera;
  const std::string topic = topic_or_only(bag, config.camera_info_topic, "sensor_msgs/CameraInfo", warnings);
  if (topic.empty()) bag.require_topic(config.camera_info_topic);
  search(bag, {topic}, [&](const rosbag::MessageInstance& message) {
    camera = raw_camera_from(*instantiate<sensor_msgs::CameraInfo>(bag, message));
    throw Found{};
  });
  if (!camera.raw.valid() || !camera.rectified.valid()) {
    throw UserError(
        fmt::format("{}: topic '{}' describes no camera (size or focal length is 0).", bag.path(), topic));
  }
  return camera;
}

}  // namespace knav
