#include "global_map_builder/observation_reader.h"

#include <fmt/format.h>
#include <kinect_nav/DepthProfile.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Joy.h>
#include <sensor_msgs/LaserScan.h>

#include <algorithm>
#include <deque>
#include <map>
#include <optional>

#include "core/error.h"
#include "core/pose_buffer.h"
#include "depth_profile_nodelet/front_end.h"
#include "global_map_builder/bag_message.h"
#include "global_map_builder/bag_transforms.h"
#include "global_map_builder/observation_source.h"
#include "ros_common/bag_reader.h"
#include "ros_common/conversions.h"

namespace knav {
namespace {

constexpr double kClockJump_s = 2.0;

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
    source_ = find_observation_source(bag_, config_, &warnings_);
    if (source_.kind == "depth") {
      front_end_.emplace(front_end);
      camera_ = find_depth_camera(bag_, config_, &warnings_);
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
    std::vector<std::string> topics = {source_.topic, source_.odometry_topic, config_.mark_topic,
                                       config_.joy_topic};
    bag_.for_each(topics, [&](const rosbag::MessageInstance& message, double progress) {
      take(message);
      release(newest_s_ - std::max(config_.reorder_s, config_.odometry_ahead_s));
      if (callbacks.progress) callbacks.progress(progress);
    });
    release(1e300);
    give_odometry(1e300);
    report();
  }

  const std::string& source() const { return source_.kind; }
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

  void take(const rosbag::MessageInstance& message) {
    const std::string topic = without_leading_slash(message.getTopic());
    const auto is = [&topic](const std::string& name) { return topic == without_leading_slash(name); };
    if (is(source_.odometry_topic)) {
      take_odometry(*instantiate<nav_msgs::Odometry>(bag_, message));
    } else if (is(source_.topic)) {
      Pending pending{Kind::kObservation, {}, {}, {}};
      ros::Time stamp;
      if (source_.kind == "profile") {
        pending.profile = instantiate<kinect_nav::DepthProfile>(bag_, message);
        stamp = pending.profile->header.stamp;
      } else if (source_.kind == "depth") {
        pending.image = instantiate<sensor_msgs::Image>(bag_, message);
        stamp = pending.image->header.stamp;
      } else {
        pending.scan = instantiate<sensor_msgs::LaserScan>(bag_, message);
        stamp = pending.scan->header.stamp;
      }
      add_pending(stamp, std::move(pending));
    } else if (is(config_.mark_topic)) {
      add_pending(message.getTime(), Pending{Kind::kMark, {}, {}, {}});
    } else if (is(config_.joy_topic)) {
      const auto joy = instantiate<sensor_msgs::Joy>(bag_, message);
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
      if (source_.upside_down) flip(&scan_);
    } else if (pending.profile) {
      try {
        profile_from(*pending.profile, &profile_);
      } catch (const UserError& error) {
        throw UserError(fmt::format("{}: topic '{}': {}", bag_.path(), source_.topic, error.what()));
      }
    } else if (!process(stamp_s, *pending.image)) {
      ++statistics_.rejected;
      return;
    }
    if (statistics_.observations++ == 0) statistics_.first_stamp_s = stamp_s;
    statistics_.last_stamp_s = stamp_s;
    if (pending.scan) {
      if (callbacks_->scan) callbacks_->scan(scan_, source_.T_plane);
    } else if (callbacks_->profile) {
      callbacks_->profile(profile_, source_.T_plane);
    }
  }

  bool process(double stamp_s, const sensor_msgs::Image& image) {
    const bool millimetres = image.encoding == "16UC1" || image.encoding == "mono16";
    if (!millimetres && image.encoding != "32FC1") {
      throw UserError(
          fmt::format("{}: topic '{}' has images of encoding '{}'; expected 16UC1 (mm) or 32FC1 (m).",
                      bag_.path(), source_.topic, image.encoding));
    }
    const std::size_t pixel_bytes = millimetres ? 2 : 4;
    if (image.step < image.width * pixel_bytes ||
        image.data.size() < std::size_t{image.step} * image.height) {
      throw UserError(fmt::format("{}: topic '{}' has an image with too few bytes for its size.", bag_.path(),
                                  source_.topic));
    }
    const cv::Mat depth(static_cast<int>(image.height), static_cast<int>(image.width),
                        millimetres ? CV_16UC1 : CV_32FC1, const_cast<std::uint8_t*>(image.data.data()),
                        image.step);
    source_.place_sensor(stamp_s);
    if (front_end_->process(depth, camera_, stamp_s, source_.T_base_sensor, pose_buffer_, &profile_))
      return true;
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
  ObservationSource source_;
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
