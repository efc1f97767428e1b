#include "global_map_builder/observation_reader.h"

#include <fmt/format.h>
#include <kinect_nav/DepthProfile.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Joy.h>
#include <sensor_msgs/LaserScan.h>
#include <std_msgs/Empty.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <optional>

#include "core/error.h"
#include "core/pose_buffer.h"
#include "depth_profile_nodelet/front_end.h"
#include "global_map_builder/bag_transforms.h"
#include "kinect_calib/depth_messages.h"
#include "ros_common/bag_reader.h"
#include "ros_common/conversions.h"

namespace knav {
namespace {

constexpr double kClockJump_s = 2.0;
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

/// A scanner mounted upside down turns clockwise.
void flip(RangeScan* scan) {
  const double last =
      scan->angle_min_rad + scan->angle_increment_rad * static_cast<double>(scan->range_m.size() - 1);
  scan->angle_min_rad = -last;
  std::reverse(scan->range_m.begin(), scan->range_m.end());
  std::reverse(scan->evidence.begin(), scan->evidence.end());
}

}  // namespace

class ObservationReader::Impl {
 public:
  Impl(const std::string& path, const ObservationReaderConfig& config, const FrontEndConfig& front_end)
      : bag_(path), config_(config) {
    choose_source();
    choose_odometry();
    find_transforms();
    if (source_ == "depth") {
      front_end_.emplace(front_end);
      find_camera();
    }
  }

  void read(const ObservationCallbacks& callbacks) {
    callbacks_ = &callbacks;
    statistics_ = {};
    pending_.clear();
    odometry_.clear();
    newest_s_ = newest_odometry_s_ = released_s_ = -1e300;
    joy_pressed_ = false;
    pose_buffer_.clear();
    std::vector<std::string> topics = {topic_, odometry_topic_, config_.mark_topic, config_.joy_topic};
    bag_.for_each(topics, [&](const rosbag::MessageInstance& message, double progress) {
      take(message);
      release(newest_s_ - std::max(config_.reorder_s, config_.odometry_ahead_s));
      if (callbacks.progress) callbacks.progress(progress);
    });
    release(1e300);
    give_odometry(1e300);
    report();
  }

  const std::string& source() const { return source_; }
  const Statistics& statistics() const { return statistics_; }
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  enum class Kind { kObservation, kMark };
  struct Pending {
    Kind kind;
    boost::shared_ptr<const kinect_nav::DepthProfile> profile;
    boost::shared_ptr<const sensor_msgs::LaserScan> scan;
    boost::shared_ptr<const sensor_msgs::Image> image;
  };

  /// `name` if the bag has it, else the only topic of that type, else empty.
  std::string topic_or_only(const std::string& name, const std::string& type) {
    const auto topics = bag_.topics_of_type(type);
    const auto same = [&](const std::string& t) {
      return without_leading_slash(t) == without_leading_slash(name);
    };
    if (std::any_of(topics.begin(), topics.end(), same)) return name;
    if (bag_.has_topic(name)) {
      throw UserError(fmt::format("{}: topic '{}' is not of type {}.", bag_.path(), name, type));
    }
    if (topics.size() != 1) return "";
    warnings_.push_back(fmt::format("topic '{}' is not in {}; taking '{}', its only {}.", name, bag_.path(),
                                    topics[0], type));
    return topics[0];
  }

  void choose_source() {
    struct Choice {
      const char* source;
      const std::string& topic;
      const char* type;
    };
    const Choice choices[] = {{"profile", config_.profile_topic, "kinect_nav/DepthProfile"},
                              {"depth", config_.depth_topic, "sensor_msgs/Image"},
                              {"scan", config_.scan_topic, "sensor_msgs/LaserScan"}};
    for (const Choice& choice : choices) {
      const bool automatic = config_.source == "auto";
      if (!automatic && config_.source != choice.source) continue;
      if (automatic && !bag_.has_topic(choice.topic)) continue;
      source_ = choice.source;
      topic_ = topic_or_only(choice.topic, choice.type);
      if (topic_.empty()) bag_.require_topic(choice.topic);
      return;
    }
    for (const Choice& choice : choices) {  // none by its usual name: the only one of its type
      if (choice.source == std::string("depth")) continue;
      topic_ = topic_or_only(choice.topic, choice.type);
      source_ = choice.source;
      if (!topic_.empty()) return;
    }
    throw UserError(fmt::format("{}: holds no observations: none of the topics '{}', '{}' and '{}' is in it.",
                                bag_.path(), config_.profile_topic, config_.depth_topic, config_.scan_topic));
  }

  void choose_odometry() {
    odometry_topic_ = topic_or_only(config_.odometry_topic, "nav_msgs/Odometry");
    if (odometry_topic_.empty()) bag_.require_topic(config_.odometry_topic);
    base_frame_ = config_.base_frame;
    search({odometry_topic_}, [&](const rosbag::MessageInstance& message) {
      const auto odometry = instantiate<nav_msgs::Odometry>(message);
      if (!odometry->child_frame_id.empty()) base_frame_ = without_leading_slash(odometry->child_frame_id);
      throw Found{};
    });
  }

  void find_transforms() {
    std::string sensor;
    search({topic_}, [&](const rosbag::MessageInstance& message) {
      if (source_ == "profile") sensor = instantiate<kinect_nav::DepthProfile>(message)->header.frame_id;
      if (source_ == "depth") sensor = instantiate<sensor_msgs::Image>(message)->header.frame_id;
      if (source_ == "scan") sensor = instantiate<sensor_msgs::LaserScan>(message)->header.frame_id;
      throw Found{};
    });
    FixedTransforms transforms;
    const auto add = [&](const rosbag::MessageInstance& message) {
      const auto tf = instantiate<tf2_msgs::TFMessage>(message);
      for (const auto& transform : tf->transforms) transforms.add(transform);
    };
    search({"tf_static"}, add);
    bool found = transforms.find(base_frame_, sensor, &T_base_sensor_);
    std::optional<ros::Time> start;
    if (!found) {
      search({"tf"}, [&](const rosbag::MessageInstance& message) {
        add(message);
        if (!start) start = message.getTime();
        found = transforms.find(base_frame_, sensor, &T_base_sensor_);
        if (found || (message.getTime() - *start).toSec() > kTransformSearch_s) throw Found{};
      });
    }
    if (found && start && source_ == "depth") follow_mount(transforms, sensor);
    if (found) {
      T_plane_ = source_ == "scan" ? planar(T_base_sensor_) : planar_optical(T_base_sensor_);
      upside_down_ = source_ == "scan" && T_base_sensor_.linear()(2, 2) < 0.0;
      return;
    }
    const std::string missing =
        fmt::format("{}: has no transform from '{}' to the sensor's frame '{}' on tf_static or tf",
                    bag_.path(), base_frame_, sensor);
    if (source_ == "depth") throw UserError(missing + "; the camera's height and tilt must be known.");
    warnings_.push_back(missing + "; taking the sensor to be at the robot's centre, looking forward.");
  }

  /// The mount came from `tf`: it may move, and then every frame has its own.
  void follow_mount(FixedTransforms transforms, const std::string& sensor) {
    bag_.for_each({"tf"}, [&](const rosbag::MessageInstance& message, double) {
      const auto tf = instantiate<tf2_msgs::TFMessage>(message);
      for (const auto& transform : tf->transforms) {
        const bool above_base = without_leading_slash(transform.child_frame_id) == base_frame_;
        Eigen::Isometry3d T_base_sensor;
        if (above_base || !transforms.replace(transform) ||
            !transforms.find(base_frame_, sensor, &T_base_sensor))
          continue;
        mount_.add(transform.header.stamp.toSec(), T_base_sensor);
      }
    });
  }

  void find_camera() {
    const std::string topic = topic_or_only(config_.camera_info_topic, "sensor_msgs/CameraInfo");
    if (topic.empty()) bag_.require_topic(config_.camera_info_topic);
    search({topic}, [&](const rosbag::MessageInstance& message) {
      camera_ = raw_camera_from(*instantiate<sensor_msgs::CameraInfo>(message));
      throw Found{};
    });
    if (!camera_.raw.valid() || !camera_.rectified.valid()) {
      throw UserError(
          fmt::format("{}: topic '{}' describes no camera (size or focal length is 0).", bag_.path(), topic));
    }
  }

  template <class Visit>
  void search(const std::vector<std::string>& topics, const Visit& visit) const {
    try {
      bag_.for_each(topics, [&](const rosbag::MessageInstance& message, double) { visit(message); });
    } catch (const Found&) {
    }
  }

  template <class Message>
  boost::shared_ptr<const Message> instantiate(const rosbag::MessageInstance& message) const {
    boost::shared_ptr<const Message> out;
    try {
      out = message.instantiate<Message>();
    } catch (const std::exception& error) {
      throw UserError(fmt::format("{}: a message on '{}' is malformed ({}).", bag_.path(), message.getTopic(),
                                  error.what()));
    }
    if (!out) {
      throw UserError(fmt::format("{}: topic '{}' has type {}, expected {}.", bag_.path(), message.getTopic(),
                                  message.getDataType(), ros::message_traits::datatype<Message>()));
    }
    return out;
  }

  void take(const rosbag::MessageInstance& message) {
    const std::string topic = without_leading_slash(message.getTopic());
    const auto is = [&topic](const std::string& name) { return topic == without_leading_slash(name); };
    if (is(odometry_topic_)) {
      take_odometry(*instantiate<nav_msgs::Odometry>(message));
    } else if (is(topic_)) {
      Pending pending{Kind::kObservation, {}, {}, {}};
      ros::Time stamp;
      if (source_ == "profile") {
        pending.profile = instantiate<kinect_nav::DepthProfile>(message);
        stamp = pending.profile->header.stamp;
      } else if (source_ == "depth") {
        pending.image = instantiate<sensor_msgs::Image>(message);
        stamp = pending.image->header.stamp;
      } else {
        pending.scan = instantiate<sensor_msgs::LaserScan>(message);
        stamp = pending.scan->header.stamp;
      }
      add_pending(stamp, std::move(pending));
    } else if (is(config_.mark_topic)) {
      add_pending(message.getTime(), Pending{Kind::kMark, {}, {}, {}});
    } else if (is(config_.joy_topic)) {
      const auto joy = instantiate<sensor_msgs::Joy>(message);
      const auto button = static_cast<std::size_t>(config_.mark_button);
      const bool pressed = button < joy->buttons.size() && joy->buttons[button] != 0;
      if (pressed && !joy_pressed_) {
        add_pending(joy->header.stamp.isZero() ? message.getTime() : joy->header.stamp,
                    Pending{Kind::kMark, {}, {}, {}});
      }
      joy_pressed_ = pressed;
    }
  }

  void check_clock(double stamp_s, double newest_s, const char* what) const {
    if (stamp_s < newest_s - kClockJump_s - config_.reorder_s) {
      throw UserError(
          fmt::format("{}: the clock of its {} jumps back by {:.1f} s at {:.3f}; cut the recording there "
                      "('rosbag filter') and use one part.",
                      bag_.path(), what, newest_s - stamp_s, newest_s));
    }
  }

  void take_odometry(const nav_msgs::Odometry& odometry) {
    const double stamp_s = odometry.header.stamp.toSec();
    const Pose2 pose = pose2_from(odometry.pose.pose);
    if (odometry.header.stamp.isZero() || !is_finite(pose)) {
      ++bad_odometry_;
      return;
    }
    check_clock(stamp_s, newest_odometry_s_, "odometry");
    if (stamp_s <= newest_odometry_s_) return;
    newest_odometry_s_ = stamp_s;
    newest_s_ = std::max(newest_s_, stamp_s);
    odometry_.emplace_back(stamp_s, pose);
  }

  void add_pending(ros::Time stamp, Pending pending) {
    if (stamp.isZero()) {
      ++statistics_.without_stamp;
      return;
    }
    const double stamp_s = stamp.toSec();
    check_clock(stamp_s, newest_s_, "observations");
    newest_s_ = std::max(newest_s_, stamp_s);
    if (stamp_s < released_s_) {
      ++statistics_.late;
      return;
    }
    pending_.emplace(stamp_s, std::move(pending));
  }

  void give_odometry(double until_s) {
    while (!odometry_.empty() && odometry_.front().first <= until_s) {
      const auto& [stamp_s, pose] = odometry_.front();
      ++statistics_.odometry;
      pose_buffer_.add(stamp_s, pose);
      if (callbacks_->add_odometry) callbacks_->add_odometry(stamp_s, pose);
      odometry_.pop_front();
    }
  }

  void release(double until_s) {
    while (!pending_.empty() && pending_.begin()->first <= until_s) {
      const double stamp_s = pending_.begin()->first;
      const Pending pending = std::move(pending_.begin()->second);
      pending_.erase(pending_.begin());
      released_s_ = stamp_s;
      give_odometry(stamp_s + config_.odometry_ahead_s);
      if (pending.kind == Kind::kMark) {
        ++statistics_.marks;
        if (callbacks_->mark) callbacks_->mark(stamp_s);
      } else {
        give_observation(stamp_s, pending);
      }
    }
  }

  void give_observation(double stamp_s, const Pending& pending) {
    if (pending.scan) {
      if (pending.scan->ranges.empty()) {
        ++statistics_.rejected;
        last_fault_ = "a scan has no readings";
        return;
      }
      scan_from(*pending.scan, &scan_);
      if (upside_down_) flip(&scan_);
    } else if (pending.profile) {
      try {
        profile_from(*pending.profile, &profile_);
      } catch (const UserError& error) {
        throw UserError(fmt::format("{}: topic '{}': {}", bag_.path(), topic_, error.what()));
      }
    } else if (!process(stamp_s, *pending.image)) {
      ++statistics_.rejected;
      return;
    }
    if (statistics_.observations++ == 0) statistics_.first_stamp_s = stamp_s;
    statistics_.last_stamp_s = stamp_s;
    if (pending.scan) {
      if (callbacks_->scan) callbacks_->scan(scan_, T_plane_);
    } else if (callbacks_->profile) {
      callbacks_->profile(profile_, T_plane_);
    }
  }

  bool process(double stamp_s, const sensor_msgs::Image& image) {
    const bool millimetres = image.encoding == "16UC1" || image.encoding == "mono16";
    if (!millimetres && image.encoding != "32FC1") {
      throw UserError(
          fmt::format("{}: topic '{}' has images of encoding '{}'; expected 16UC1 (mm) or 32FC1 (m).",
                      bag_.path(), topic_, image.encoding));
    }
    const std::size_t pixel_bytes = millimetres ? 2 : 4;
    if (image.step < image.width * pixel_bytes ||
        image.data.size() < std::size_t{image.step} * image.height) {
      throw UserError(
          fmt::format("{}: topic '{}' has an image with too few bytes for its size.", bag_.path(), topic_));
    }
    const cv::Mat depth(static_cast<int>(image.height), static_cast<int>(image.width),
                        millimetres ? CV_16UC1 : CV_32FC1, const_cast<std::uint8_t*>(image.data.data()),
                        image.step);
    if (!mount_.empty()) {
      T_base_sensor_ = mount_.at(stamp_s);
      T_plane_ = planar_optical(T_base_sensor_);
    }
    if (front_end_->process(depth, camera_, stamp_s, T_base_sensor_, pose_buffer_, &profile_)) return true;
    last_fault_ = front_end_->fault();
    return false;
  }

  void report() {
    if (statistics_.rejected > 0) {
      warnings_.push_back(
          fmt::format("{} observations could not be used: {}", statistics_.rejected, last_fault_));
    }
    if (statistics_.late > 0) {
      warnings_.push_back(fmt::format("{} observations came more than {} s late and were left out.",
                                      statistics_.late, config_.reorder_s));
    }
    if (statistics_.without_stamp > 0) {
      warnings_.push_back(
          fmt::format("{} messages carry no stamp and were left out.", statistics_.without_stamp));
    }
    if (bad_odometry_ > 0) {
      warnings_.push_back(
          fmt::format("{} odometry messages hold NaN or no stamp and were left out.", bad_odometry_));
    }
  }

  BagReader bag_;
  ObservationReaderConfig config_;
  std::string source_, topic_, odometry_topic_, base_frame_;
  Eigen::Isometry3d T_base_sensor_ = Eigen::Isometry3d::Identity();
  MovingTransform mount_;
  Pose2 T_plane_;
  bool upside_down_ = false;
  RawCamera camera_;
  std::optional<FrontEnd> front_end_;
  std::vector<std::string> warnings_;

  const ObservationCallbacks* callbacks_ = nullptr;
  Statistics statistics_;
  std::multimap<double, Pending> pending_;
  std::deque<std::pair<double, Pose2>> odometry_;
  PoseBuffer pose_buffer_;
  double newest_s_ = 0.0, newest_odometry_s_ = 0.0, released_s_ = 0.0;
  bool joy_pressed_ = false;
  std::size_t bad_odometry_ = 0;
  std::string last_fault_;
  DepthProfile profile_;
  RangeScan scan_;
};

ObservationReader::ObservationReader(const std::string& bag_path, const ObservationReaderConfig& config,
                                     const FrontEndConfig& front_end)
    : impl_(std::make_unique<Impl>(bag_path, config, front_end)) {}
ObservationReader::~ObservationReader() = default;
const std::string& ObservationReader::source() const { return impl_->source(); }
void ObservationReader::read(const ObservationCallbacks& callbacks) { impl_->read(callbacks); }
const ObservationReader::Statistics& ObservationReader::statistics() const { return impl_->statistics(); }
const std::vector<std::string>& ObservationReader::warnings() const { return impl_->warnings(); }

}  // namespace knav
